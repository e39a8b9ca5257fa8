import { CommandButton, send } from './commands';
import { Keyed, byId, drawing, element, mark, say, show } from './dom';
import { age, count, fixed, typedNumber } from './format';
import type { Board, State, Station } from './state';

/** "Seen 4 of 5" and what is missing. */
export function needed(state: State): void {
  const need = state.needed;
  show(byId('needed'), need !== null);
  if (!need) return;
  const missing = need.missing.length > 0;
  mark(byId('needed'), 'data-level', missing || need.seen < need.want ? 'warning' : 'ok');
  say(byId('needed-text'), `Needed ${need.want}, seen ${need.seen}`);
  say(byId('needed-missing'), missing ? `Missing: ${need.missing.join(', ')}` : need.seen < need.want ? '' : 'All are seen');
}

const healthWords = { OK: 'OK', WARNING: 'Warning', FAIL: 'Fail', NONE: 'Not checked' } as const;

export function health(state: State): void {
  const { level, text } = state.health;
  mark(byId('health-text'), 'data-level', level.toLowerCase());
  say(byId('health-text'), `${healthWords[level] ?? level}${text ? `: ${text}` : ''}`);
}

/** The X position with its age and source; typed where the machine does not tell it. */
export class AxisPanel {
  private readonly set = new CommandButton('axis-button', 'Set', () => this.typed(), { className: 'small strong' });
  private state: State['axis'] | null = null;
  private since = 0;

  constructor() {
    byId('axis-set').append(this.set.root);
    byId('axis-form').addEventListener('submit', (event) => {
      event.preventDefault();
      this.set.press();
    });
  }

  private typed(): { command: 'axis'; position_mm: number } | null {
    const input = byId<HTMLInputElement>('axis-input');
    const position = typedNumber(input.value);
    mark(input, 'aria-invalid', position === null ? 'true' : null);
    say(byId('axis-error'), position === null ? 'Type a number in millimetres, for example 850.04.' : '');
    if (position === null) {
      input.focus();
      return null;
    }
    input.select();
    return { command: 'axis', position_mm: position };
  }

  update(state: State, barred: string): void {
    this.state = state.axis;
    this.since = performance.now();
    say(byId('axis-value'), state.axis.position_mm === null ? 'unknown' : `${fixed(state.axis.position_mm, 2)} mm`);
    show(byId('axis-trouble'), state.axis.trouble !== '');
    say(byId('axis-trouble'), state.axis.trouble);
    show(byId('axis-form'), state.axis.typed);
    // The board is shown by hand: the beam matters from the second stage on.
    show(byId('axis'), state.stage !== 'calibrate');
    this.bar(barred);
    this.tick();
  }

  bar(barred: string): void {
    this.set.allow(barred);
  }

  tick(): void {
    if (!this.state) return;
    const { source, age_s, fresh, position_mm } = this.state;
    const since = age_s === null ? null : age_s + (performance.now() - this.since) / 1000;
    const old = position_mm !== null && !fresh;
    say(byId('axis-age'), [source, age(since), old ? 'too old' : ''].filter((part) => part).join(', '));
    mark(byId('axis'), 'data-level', old ? 'warning' : null);
  }
}

const cell = 20;

/** How often each part of one camera's image has seen the board. */
class Grid {
  readonly root = element('figure');
  private readonly svg = drawing('svg', { role: 'img', class: 'coverage' });
  private readonly caption = element('figcaption');
  private readonly cells: { box: SVGRectElement; number: SVGTextElement }[] = [];
  private readonly wanted = drawing('rect', { class: 'wanted-cell', width: cell - 2, height: cell - 2 });
  private size = '';

  constructor(private readonly side: Board['cell_side']) {
    this.root.append(this.caption, this.svg);
  }

  update(board: Board, counts: number[]): void {
    const size = `0 0 ${board.columns * cell} ${board.rows * cell}`;
    if (size !== this.size) this.build(board, size);
    let covered = 0;
    this.cells.forEach(({ box, number }, i) => {
      const seen = counts[i] ?? 0;
      if (seen > 0) covered++;
      mark(box, 'class', `c${Math.min(4, seen)}`);
      mark(number, 'class', seen > 2 ? 'light' : '');
      say(number, seen > 0 ? String(Math.min(99, seen)) : '');
    });
    // The wanted part is of one camera's image only.
    const here = board.cell_side === this.side ? board.cell : null;
    const [column, row] = here ?? [-1, -1];
    mark(this.wanted, 'visibility', here ? 'visible' : 'hidden');
    if (here) {
      mark(this.wanted, 'x', String(column * cell + 1));
      mark(this.wanted, 'y', String(row * cell + 1));
    }
    const text = `${this.side === 'left' ? 'Left' : 'Right'}: ${covered} of ${this.cells.length}`;
    say(this.caption, text);
    mark(this.svg, 'aria-label', `${text} parts of the image covered${here ? `; wanted: column ${column + 1}, row ${row + 1}` : ''}`);
  }

  private build(board: Board, size: string): void {
    this.size = size;
    mark(this.svg, 'viewBox', size);
    this.cells.length = 0;
    this.svg.replaceChildren();
    for (let i = 0; i < Math.min(1024, board.columns * board.rows); i++) {
      const x = (i % board.columns) * cell;
      const y = Math.floor(i / board.columns) * cell;
      const box = drawing('rect', { x: x + 0.5, y: y + 0.5, width: cell - 1, height: cell - 1 });
      const number = drawing('text', { x: x + cell / 2, y: y + cell / 2 + 4 });
      this.svg.append(box, number);
      this.cells.push({ box, number });
    }
    this.svg.append(this.wanted);
  }
}

const tiltWords: Record<string, string> = { left: 'left', right: 'right', up: 'up', down: 'down', rolled: 'rolled' };

export class BoardPanel {
  private readonly left = new Grid('left');
  private readonly right = new Grid('right');

  constructor() {
    byId('board-grids').append(this.left.root, this.right.root);
  }

  update(state: State): void {
    const { board } = state;
    show(byId('board'), board !== null);
    if (!board) return;
    say(byId('board-poses'), count(board.poses, 'pose'));
    // Where the instruction says the same, once is enough.
    const told = state.instruction.toLowerCase().includes(board.wanted.toLowerCase().replace(/\.$/, ''));
    show(byId('board-wanted'), !told);
    say(byId('board-wanted'), board.wanted);
    this.left.update(board, board.left);
    this.right.update(board, board.right);
    say(byId('board-tilts'), `Tilted: ${Object.entries(board.tilts).map(([name, times]) => `${tiltWords[name] ?? name} ${times}`).join(', ')}`);
  }
}

const crossWords = { none: '\u2013', missing: 'missing', taken: 'taken' } as const;
const scanWords = { none: '\u2013', missing: 'missing', taken: 'taken', done: 'done' } as const;

interface StationRow {
  root: HTMLTableRowElement;
  button: HTMLButtonElement;
  place: HTMLElement;
  cross: HTMLElement;
  scan: HTMLElement;
  epipolar: HTMLElement;
}

export class Stations {
  private readonly rows: Keyed<Station, StationRow>;
  private barred = '';
  private current = '';

  constructor() {
    this.rows = new Keyed(byId('stations-rows'), (station) => this.make(station.name), (made, station) => this.fill(made, station));
  }

  private make(name: string): StationRow {
    const root = element('tr');
    const head = element('th');
    head.scope = 'row';
    const button = element('button', 'station', name);
    button.type = 'button';
    button.addEventListener('click', () => {
      if (!this.barred) void send({ command: 'select', station: name });
    });
    head.append(button);
    const [place, cross, scan, epipolar] = [element('td', 'n'), element('td'), element('td'), element('td', 'n')];
    root.append(head, place, cross, scan, epipolar);
    return { root, button, place, cross, scan, epipolar };
  }

  private fill(made: StationRow, station: Station): void {
    mark(made.button, 'aria-current', station.current ? 'true' : null);
    mark(made.button, 'aria-disabled', this.barred ? 'true' : null);
    mark(made.root, 'data-current', station.current ? 'yes' : null);
    say(made.place, fixed(station.measured_mm ?? station.axis_mm, station.measured_mm === null ? 0 : 2));
    say(made.cross, crossWords[station.cross] ?? station.cross);
    mark(made.cross, 'data-state', station.cross);
    say(made.scan, scanWords[station.scan] ?? station.scan);
    mark(made.scan, 'data-state', station.scan);
    say(made.epipolar, fixed(station.epipolar_px, 3));
    if (station.current && this.current !== station.name) {
      this.current = station.name;
      const box = made.root.closest('.table');
      // Only the list itself is scrolled, never the page.
      if (box && made.root.offsetHeight > 0) box.scrollTop = made.root.offsetTop - box.clientHeight / 2;
    }
  }

  update(state: State, barred: string): void {
    this.barred = barred;
    show(byId('stations'), state.stations.length > 0);
    const wanted = state.stations.filter((station) => (state.stage === 'scan' ? station.scan : station.cross) !== 'none');
    const done = wanted.filter((station) => (state.stage === 'scan' ? station.scan === 'done' || station.scan === 'taken' : station.cross === 'taken'));
    say(byId('stations-count'), `${done.length} of ${wanted.length} ${state.stage === 'scan' ? 'scanned' : 'with the cross'}`);
    this.rows.update(state.stations, (station) => station.name);
  }
}
