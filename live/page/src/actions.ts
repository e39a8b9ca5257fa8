import { CommandButton, send } from './commands';
import { Keyed, byId, element, mark, say, show } from './dom';
import { fixed } from './format';
import type { Deed, Stage, State } from './state';

const deeds: { deed: Deed; label: string; key?: string; className: string }[] = [
  { deed: 'next', label: 'Next', key: 'N', className: 'deed primary' },
  { deed: 'repeat', label: 'Repeat', key: 'R', className: 'deed' },
  { deed: 'undo', label: 'Undo', key: 'U', className: 'deed' },
  { deed: 'check', label: 'Check head', className: 'deed lesser' },
  { deed: 'finish', label: 'Finish stage', className: 'deed lesser' },
];

const stateWords: Record<Stage['state'], string> = { empty: 'not begun', begun: 'begun', ready: 'ready to finish', done: 'done' };

/** A reason as the program words it, as the end of "Next: ...". */
export function reasonFor(state: State, deed: Deed, barred: string): string {
  if (barred) return barred;
  return state.can[deed] ? '' : (state.why_not[deed] || 'not possible now').replace(/\.$/, '');
}

interface StageTab {
  root: HTMLLIElement;
  button: HTMLButtonElement;
  title: HTMLElement;
  what: HTMLElement;
}

export class Actions {
  private readonly buttons = new Map<Deed, CommandButton>();
  private readonly cancel = new CommandButton('cancel', 'Cancel', () => ({ command: 'cancel' }), { className: 'deed stop' });
  private readonly stages: Keyed<Stage, StageTab>;
  private current = '';
  private barred = '';
  private work: State['work'] = null;
  private since = 0;

  constructor() {
    const bar = byId('buttons');
    for (const { deed, label, key, className } of deeds) {
      const made = new CommandButton(deed, label, () => ({ command: deed } as { command: 'next' }), { className, ...(key ? { key } : {}) });
      if (key) made.button.setAttribute('aria-keyshortcuts', key);
      made.root.classList.add(`command-${deed}`);
      bar.append(made.root);
      this.buttons.set(deed, made);
    }
    byId('work-cancel').append(this.cancel.root);
    this.stages = new Keyed(byId('stages'), (stage) => this.makeStage(stage), (made, stage) => this.fillStage(made, stage));
    addEventListener('keydown', (event) => this.shortcut(event));
  }

  private makeStage(stage: Stage): StageTab {
    const root = element('li');
    const button = element('button', 'stage');
    button.type = 'button';
    const title = element('span', 'stage-title');
    const what = element('span', 'stage-what');
    button.append(title, what);
    button.addEventListener('click', () => {
      if (!this.barred && stage.name !== this.current) void send({ command: 'stage', name: stage.name });
    });
    root.append(button);
    return { root, button, title, what };
  }

  private fillStage(made: StageTab, stage: Stage): void {
    say(made.title, stage.title);
    const many = stage.want > 0 ? `${stage.have} of ${stage.want}, ` : '';
    say(made.what, many + (stateWords[stage.state] ?? stage.state));
    mark(made.button, 'aria-current', stage.name === this.current ? 'step' : null);
    mark(made.button, 'aria-disabled', this.barred ? 'true' : null);
    mark(made.button, 'title', this.barred || stage.summary || null);
    mark(made.button, 'data-state', stage.state);
  }

  private shortcut(event: KeyboardEvent): void {
    if (event.defaultPrevented || event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
    if (!byId<HTMLInputElement>('shortcuts').checked) return;
    const target = event.target;
    if (target instanceof HTMLElement && (target.isContentEditable || target.matches('select, textarea, input:not([type="checkbox"])'))) return;
    const deed = deeds.find((entry) => entry.key === event.key.toUpperCase())?.deed;
    if (!deed) return;
    event.preventDefault();
    this.buttons.get(deed)!.press();
  }

  bar(barred: string, state: State | null): void {
    this.barred = barred;
    for (const { deed } of deeds) this.buttons.get(deed)!.allow(state ? reasonFor(state, deed, barred) : barred);
    this.cancel.allow(state ? reasonFor(state, 'cancel', barred) : barred);
  }

  update(state: State, barred: string): void {
    this.current = state.stage;
    this.bar(barred, state);
    say(byId('job'), state.job.name || 'crosstie live');
    say(byId('folder'), state.job.folder);
    mark(byId('job'), 'title', state.job.name);
    mark(byId('folder'), 'title', state.job.folder);
    const title = `${state.job.name || 'crosstie'} \u2013 live`;
    if (document.title !== title) document.title = title;
    this.stages.update(state.stages, (stage) => stage.name);
    say(byId('instruction'), state.instruction);
    mark(byId('instruction'), 'data-long', state.instruction.length > 90 ? 'yes' : null);
    this.work = state.work;
    this.since = performance.now();
    this.progress();
    const last = state.log[state.log.length - 1];
    const line = byId('last');
    show(line, !state.work);
    say(line, last ? `${last.time}  ${last.text}` : '');
    mark(line, 'data-level', last?.level ?? null);
  }

  tick(): void {
    if (this.work) this.progress();
  }

  private progress(): void {
    const work = this.work;
    show(byId('work'), work !== null);
    if (!work) return;
    say(byId('work-what'), work.what);
    say(byId('work-stage'), work.stage);
    const bar = byId<HTMLProgressElement>('work-bar');
    if (work.total > 0) {
      mark(bar, 'max', String(work.total));
      mark(bar, 'value', String(Math.min(work.done, work.total)));
    } else {
      mark(bar, 'value', null);
    }
    const seconds = work.seconds + (performance.now() - this.since) / 1000;
    say(byId('work-count'), `${work.total > 0 ? `${work.done} of ${work.total}, ` : ''}${fixed(seconds, 0)} s`);
  }
}
