import { Actions } from './actions';
import { Cameras } from './cameras';
import { watchingOnly } from './commands';
import { byId, say, show } from './dom';
import { typedNumber } from './format';
import { Link } from './link';
import { AxisPanel, BoardPanel, Stations, health, needed } from './side';
import { SpaceView } from './space';
import type { State } from './state';
import { Drift, Log, MarkerTable, Verdicts } from './tables';
import { recallToken, takeToken, token } from './token';

const format = 'crosstie-live/1';

recallToken();
takeToken();

const actions = new Actions();
const cameras = new Cameras(typedNumber);
const axis = new AxisPanel();
const board = new BoardPanel();
const stations = new Stations();
const markers = new MarkerTable();
const verdicts = new Verdicts();
const log = new Log();
const drift = new Drift();
const space = new SpaceView();

let newest: State | null = null;
let asked = false;
let connected = false;
let shut = '';

/** Why no command may be sent at all, or nothing. */
function barred(): string {
  if (!connected) return 'not connected';
  if (shut) return shut;
  return token() ? '' : watchingOnly;
}

/** One piece that fails must not take the others with it. */
function guarded(name: string, piece: () => void): void {
  try {
    piece();
  } catch (error) {
    console.warn(`crosstie: ${name} could not be shown`, error);
  }
}

function draw(): void {
  asked = false;
  const state = newest;
  if (!state) return;
  const bar = barred();
  guarded('the actions', () => actions.update(state, bar));
  guarded('the cameras', () => cameras.update(state, bar));
  guarded('the needed markers', () => needed(state));
  guarded('the board', () => board.update(state));
  guarded('the axis', () => axis.update(state, bar));
  guarded('the stations', () => stations.update(state, bar));
  guarded('the head check', () => health(state));
  guarded('the markers', () => markers.update(state));
  guarded('the verdicts', () => verdicts.update(state));
  guarded('the drift', () => drift.update(state));
  guarded('the log', () => log.update(state));
  guarded('the 3D view', () => space.update(state));
  say(byId('foot'), `crosstie live, state ${state.sequence} of ${state.time}`);
}

function ask(): void {
  if (asked) return;
  asked = true;
  // A hidden window draws nothing, and catches up when it is seen.
  requestAnimationFrame(draw);
}

function access(): void {
  const bar = barred();
  actions.bar(bar, newest);
  cameras.bar(bar);
  axis.bar(bar);
  document.documentElement.classList.toggle('old', !connected);
  const box = byId('watching');
  show(box, connected && !token());
  say(box, 'Watching only. To command, open the address that the program printed; it ends in # and a token.');
  ask();
}

addEventListener('hashchange', () => {
  if (takeToken()) access();
});
addEventListener('crosstie-token', access);
byId<HTMLInputElement>('shortcuts').addEventListener('change', (event) => {
  document.documentElement.classList.toggle('no-keys', !(event.target as HTMLInputElement).checked);
});
setInterval(() => {
  actions.tick();
  axis.tick();
  cameras.tick();
}, 1000);

const link = new Link({
  open: () => {
    connected = true;
    show(byId('lost'), false);
    space.forget();
    cameras.again();
    access();
  },
  lost: (why, seconds) => {
    connected = false;
    const text = newest ? `Connection lost. ${why} What is shown is old.` : `No connection. ${why}`;
    say(byId('lost'), text);
    show(byId('lost'), true);
    byId('lost').dataset['wait'] = String(seconds);
    access();
  },
  state: (state) => {
    shut = state.format === format ? '' : 'this page is of another version: load it anew';
    newest = state;
    if (shut) {
      say(byId('lost'), `The program speaks ${state.format}, this page ${format}: load the page anew.`);
      show(byId('lost'), true);
    }
    ask();
  },
});
access();
void link.run();
