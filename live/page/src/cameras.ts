import { CommandButton } from './commands';
import { Keyed, byId, drawing, element, mark, say, show } from './dom';
import { count, figures, fixed, percent } from './format';
import { Histogram } from './histogram';
import type { Camera, State } from './state';
import { Stream } from './stream';

const titles = { left: 'Left camera', right: 'Right camera' };

/** A fact as label and value; `tell` marks it where the operator should act. */
class Fact {
  readonly root = element('div', 'fact');
  private readonly value = element('dd');

  constructor(label: string) {
    this.root.append(element('dt', '', label), this.value);
  }

  tell(text: string, level: '' | 'warning' | 'fail' = ''): void {
    say(this.value, text);
    mark(this.root, 'data-level', level || null);
  }
}

const shapes = {
  coded: { tag: 'circle', attributes: { cx: 8, cy: 8, r: 6 } },
  uncoded: { tag: 'path', attributes: { d: 'M2 2H14V14H2Z' } },
  doubtful: { tag: 'path', attributes: { d: 'M8 1.5L15 14.5H1Z' } },
} as const;

class Legend {
  readonly root = element('ul', 'legend');
  private readonly words = new Map<string, HTMLElement>();

  constructor() {
    for (const kind of ['coded', 'uncoded', 'doubtful'] as const) {
      const sign = drawing('svg', { viewBox: '0 0 16 16', class: `shape ${kind}`, 'aria-hidden': 'true' });
      sign.append(drawing(shapes[kind].tag, shapes[kind].attributes));
      const words = element('span');
      const item = element('li');
      item.append(sign, words);
      this.root.append(item);
      this.words.set(kind, words);
    }
  }

  update(camera: Camera): void {
    for (const kind of ['coded', 'uncoded', 'doubtful'] as const) say(this.words.get(kind)!, `${camera[kind]} ${kind}`);
  }
}

export class CameraPanel {
  readonly root = element('article', 'camera');
  private readonly name = element('span', 'muted');
  private readonly picture = element('div', 'picture');
  private readonly image = element('img');
  private readonly over = element('p', 'over');
  private readonly trouble = element('p', 'trouble');
  private readonly histogram = new Histogram();
  private readonly legend = new Legend();
  private readonly light = new Fact('Saturated');
  private readonly dark = new Fact('Dark');
  private readonly focus = new Fact('Focus');
  private readonly blur = new Fact('Blur');
  private readonly rate = new Fact('Frames/s');
  private readonly latency = new Fact('Latency');
  private readonly temperature = new Fact('Temperature');
  private readonly losses = element('p', 'losses');
  readonly stream: Stream;
  private running = false;
  private broken = false;

  constructor(side: 'left' | 'right') {
    const heading = element('h3', '', titles[side]);
    heading.id = `camera-${side}`;
    this.root.setAttribute('aria-labelledby', heading.id);
    const head = element('div', 'camera-head');
    head.append(heading, this.name);
    this.image.alt = `${titles[side]}: live picture with the markers found`;
    this.stream = new Stream(this.image, `/camera/${side}`);
    this.image.addEventListener('error', () => this.covered(true));
    this.image.addEventListener('load', () => this.covered(false));
    this.picture.append(this.image, this.over);
    const light = element('dl', 'facts');
    light.append(this.light.root, this.dark.root, this.focus.root, this.blur.root);
    const flow = element('dl', 'facts flow');
    flow.append(this.rate.root, this.latency.root, this.temperature.root);
    const measured = element('div', 'measured');
    measured.append(this.histogram.root, light);
    this.root.append(head, this.trouble, this.picture, this.legend.root, measured, flow, this.losses);
    this.covered(true);
  }

  private covered(broken: boolean): void {
    this.broken = broken;
    this.cover();
  }

  private cover(): void {
    const text = !this.running ? 'This camera does not run' : this.broken ? 'No picture yet' : '';
    show(this.over, text !== '');
    say(this.over, text);
  }

  update(camera: Camera): void {
    say(this.name, camera.name);
    show(this.trouble, camera.trouble !== '');
    say(this.trouble, camera.trouble);
    if (camera.running && !this.running) this.stream.begin();
    this.running = camera.running;
    this.cover();
    mark(this.root, 'data-running', camera.running ? 'yes' : 'no');
    this.stream.count(camera.frames);
    if (camera.width_px && camera.height_px) {
      const shape = `${camera.width_px} / ${camera.height_px}`;
      if (this.picture.style.aspectRatio !== shape) this.picture.style.aspectRatio = shape;
    }
    this.histogram.update(camera);
    this.legend.update(camera);
    this.light.tell(percent(camera.saturated), (camera.saturated ?? 0) > 0.01 ? 'warning' : '');
    this.dark.tell(percent(camera.dark), (camera.dark ?? 0) > 0.5 ? 'warning' : '');
    this.focus.tell(fixed(camera.focus, 2));
    this.blur.tell(camera.blur_px === null ? '\u2013' : `${fixed(camera.blur_px, 1)} px`);
    this.rate.tell(fixed(camera.rate_hz, 1));
    this.latency.tell(camera.latency_ms === null ? '\u2013' : `${fixed(camera.latency_ms, 0)} ms`);
    const warming = camera.warming ? ', warming up' : '';
    this.temperature.tell(camera.temperature_c === null ? `not told${warming}` : `${fixed(camera.temperature_c, 1)} \u00b0C${warming}`,
      camera.warming ? 'warning' : '');
    const bad = (['dropped', 'lost', 'swapped', 'incomplete'] as const).map((kind) => `${camera[kind]} ${kind}`);
    say(this.losses, `${count(camera.frames, 'frame')}: ${bad.join(', ')}`);
    mark(this.losses, 'data-level', camera.lost + camera.swapped + camera.incomplete > 0 ? 'warning' : null);
  }
}

export class Cameras {
  private readonly panels = new Map<string, CameraPanel>();
  private readonly keyed: Keyed<Camera, CameraPanel>;
  private readonly exposure = new CommandButton('exposure', 'Set', () => this.typed(), { className: 'small' });
  private readonly reconnect = new CommandButton('reconnect', 'Connect the cameras again', () => ({ command: 'reconnect' }), { className: 'small' });
  private readonly reconnectNow = new CommandButton('reconnect-now', 'Connect the cameras again', () => ({ command: 'reconnect' }), { className: 'small strong' });
  private readonly parse: (text: string) => number | null;

  constructor(parse: (text: string) => number | null) {
    this.parse = parse;
    this.keyed = new Keyed(byId('cameras'), (camera) => {
      const made = new CameraPanel(camera.side === 'right' ? 'right' : 'left');
      this.panels.set(camera.side, made);
      return made;
    }, (made, camera) => made.update(camera));
    byId('exposure-set').append(this.exposure.root);
    byId('settings-buttons').append(this.reconnect.root);
    byId('again-button').append(this.reconnectNow.root);
    byId('exposure-form').addEventListener('submit', (event) => {
      event.preventDefault();
      this.exposure.press();
    });
    document.addEventListener('visibilitychange', () => {
      for (const panel of this.panels.values()) document.hidden ? panel.stream.pause() : panel.stream.begin();
    });
  }

  private typed(): { command: 'exposure'; exposure_s: number; gain: number } | null {
    const exposure = byId<HTMLInputElement>('exposure-input');
    const gain = byId<HTMLInputElement>('gain-input');
    const ms = this.parse(exposure.value);
    const db = gain.value.trim() === '' ? 0 : this.parse(gain.value);
    const wrong = ms === null || !(ms > 0) ? 'Type the exposure in milliseconds, for example 10.'
      : db === null || db < 0 ? 'Type the gain in dB, 0 or more.' : '';
    say(byId('exposure-error'), wrong);
    mark(exposure, 'aria-invalid', ms === null || !(ms > 0) ? 'true' : null);
    mark(gain, 'aria-invalid', db === null || db < 0 ? 'true' : null);
    if (wrong) return null;
    return { command: 'exposure', exposure_s: Number((ms! / 1000).toPrecision(9)), gain: db! };
  }

  update(state: State, barred: string): void {
    this.keyed.update(state.cameras, (camera) => camera.side);
    this.bar(barred);
    const still = state.cameras.filter((camera) => !camera.running).length;
    show(byId('again'), still > 0);
    say(byId('again').firstElementChild!, still > 1 ? 'The cameras do not run.' : 'A camera does not run.');
    const { pairs } = state;
    say(byId('pairs'), `${count(pairs.count, 'pair')} of pictures: ${pairs.unmatched} without partner, ${pairs.contradicted} contradicted`);
    mark(byId('pairs'), 'data-level', pairs.contradicted > 0 ? 'warning' : null);
    const now = state.cameras.map((camera) =>
      `${camera.side} ${camera.exposure_s === null ? '\u2013' : `${figures(1000 * camera.exposure_s)} ms`}, ${camera.gain === null ? '\u2013' : `${figures(camera.gain)} dB`}`);
    say(byId('exposure-now'), now.length > 0 ? `Now: ${now.join('; ')}. Both cameras get the same.` : '');
  }

  bar(barred: string): void {
    this.exposure.allow(barred);
    this.reconnect.allow(barred);
    this.reconnectNow.allow(barred);
  }

  /** After the program came back its streams are new. */
  again(): void {
    if (!document.hidden) for (const panel of this.panels.values()) panel.stream.begin();
  }

  tick(): void {
    for (const panel of this.panels.values()) panel.stream.watch();
  }
}
