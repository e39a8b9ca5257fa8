import { BufferAttribute, BufferGeometry, LineSegments, Material, Object3D, Points, PointsMaterial } from 'three';
import { Line2 } from 'three/examples/jsm/lines/Line2.js';
import { LineGeometry } from 'three/examples/jsm/lines/LineGeometry.js';
import { LineMaterial } from 'three/examples/jsm/lines/LineMaterial.js';
import { themeColour } from '../../../report/viewer/src/colour';
import { Labels } from '../../../report/viewer/src/labels';
import { makeCameras, makePoints } from '../../../report/viewer/src/objects';
import type { Scene, SceneCamera, ScenePoint } from '../../../report/viewer/src/scene';
import { Stage, nearest } from '../../../report/viewer/src/stage';
import { byId, element, say, show } from './dom';
import { count, fixed } from './format';
import type { Space, State, Triple } from './state';

const pickRadiusPx = 18;
const patchVariables = ['--series-1', '--series-4', '--series-6', '--series-5', '--series-3', '--series-2'];

/** Points of a patch: base64 of little-endian float32 x y z. */
export function decodePoints(base64: string): Float32Array {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const whole = new DataView(bytes.buffer, 0, bytes.byteLength - (bytes.byteLength % 12));
  const points = new Float32Array(whole.byteLength / 4);
  for (let i = 0; i < points.length; i++) points[i] = whole.getFloat32(4 * i, true);
  return points;
}

/** The head as the reports draw a camera: its axes stand in the columns. */
function headCamera(head: NonNullable<Space['head']>): SceneCamera {
  const a = head.axes;
  const direction = (x: number, y: number): Triple => [0, 1, 2].map((row) => a[3 * row]! * x + a[3 * row + 1]! * y + a[3 * row + 2]!) as Triple;
  return {
    name: 'head',
    centre: head.position_mm,
    corners: [direction(-0.5, -0.42), direction(0.5, -0.42), direction(0.5, 0.42), direction(-0.5, 0.42)],
    group: 0,
  };
}

/** Markers and the marks of the gaps, in the form of the reports' viewer. */
function reportScene(space: Space): Scene {
  const markers = space.markers.map((marker): ScenePoint => ({
    id: String(marker.id),
    p: marker.xyz_mm,
    axes: [],
    value: marker.sigma_mm ?? 0,
    about: [
      `Marker ${marker.id}${marker.live ? ', seen now' : ''}`,
      `x ${fixed(marker.xyz_mm[0], 2)}  y ${fixed(marker.xyz_mm[1], 2)}  z ${fixed(marker.xyz_mm[2], 2)} mm`,
      marker.sigma_mm === null ? 'sigma unknown' : `sigma ${fixed(marker.sigma_mm, 3)} mm`,
    ],
    seen: [],
    ring: !marker.live,
  }));
  const gaps = space.rim.filter((piece) => piece.gap && piece.xyz_mm.length > 0).map((piece): ScenePoint => ({
    id: 'gap',
    p: piece.xyz_mm[Math.floor(piece.xyz_mm.length / 2)]!,
    axes: [],
    value: 0,
    about: ['Gap in the edge of the hole'],
    seen: [],
  }));
  return {
    points: [...markers, ...gaps],
    cameras: space.head ? [headCamera(space.head)] : [],
    bars: [],
    legend: { label: 'sigma, mm', min: 0, max: sigmaRange(space), open: false },
    magnification: 1,
    up: space.head ? [-space.head.axes[1]!, -space.head.axes[4]!, -space.head.axes[7]!] : [0, 0, 1],
    towards: space.head ? [space.head.axes[2]!, space.head.axes[5]!, space.head.axes[8]!] : [0, 1, 0],
  };
}

/** Of the colours, in mm. */
function sigmaRange(space: Space): number {
  return Math.max(...space.markers.map((marker) => marker.sigma_mm ?? 0), 0.05);
}

function patch(points: Float32Array, colour: number): Points {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(points, 3));
  const variable = patchVariables[((colour % patchVariables.length) + patchVariables.length) % patchVariables.length]!;
  return new Points(geometry, new PointsMaterial({ size: 2 * Math.min(2, devicePixelRatio), sizeAttenuation: false, color: themeColour(variable, '#2c6fb0') }));
}

/** A wide line: measured edge green, gaps red and dashed, drawn over all else. */
function rim(piece: Space['rim'][number], length_mm: number): Line2 {
  const geometry = new LineGeometry();
  geometry.setPositions(piece.xyz_mm.flat());
  const material = new LineMaterial({
    color: themeColour(piece.gap ? '--fail' : '--ok', piece.gap ? '#a31515' : '#146c2e').getHex(),
    linewidth: piece.gap ? 7 : 4,
    dashed: piece.gap,
    dashSize: length_mm / 120,
    gapSize: length_mm / 240,
    depthTest: !piece.gap,
  });
  const line = new Line2(geometry, material);
  if (piece.gap) line.renderOrder = 1;
  line.computeLineDistances();
  return line;
}

const label = '3D view. Arrow keys turn, plus and minus zoom, page up and page down step through the markers, Escape deselects, 0 resets.';

export class SpaceView {
  private readonly host = byId('space');
  private stage: Stage | undefined;
  private readonly about = element('div', 'viewer-about');
  private labels: Labels | undefined;
  private scene: Scene | undefined;
  private places: Triple[] = [];
  private drawn: Object3D[] = [];
  private selected = '';
  private touched = false;
  private frame = '';
  private shown = -1;
  private busy = false;
  private retryAt = 0;
  private etag = '';

  constructor() {
    if (!document.createElement('canvas').getContext('webgl2')) {
      this.host.append(element('p', 'muted', 'This browser offers no WebGL, which the 3D view needs. The table and the texts tell the same.'));
      return;
    }
    try {
      this.begin();
    } catch {
      this.stage = undefined;
      this.host.replaceChildren(element('p', 'muted', 'The 3D view could not begin. The table and the texts tell the same.'));
    }
  }

  private begin(): void {
    const stage = new Stage(label, {
      drawn: (camera, width, height) => this.labels?.place(camera, width, height, this.index()),
      tapped: (x, y) => this.select(nearest(stage, this.scene?.points.map((point) => point.p) ?? [], x, y, pickRadiusPx)),
      key: (key) => this.key(key),
      themed: () => undefined,
    });
    this.stage = stage;
    this.about.setAttribute('role', 'status');
    stage.element.append(this.about);
    for (const kind of ['pointerdown', 'wheel', 'keydown']) {
      stage.element.addEventListener(kind, () => {
        this.touched = true;
      }, { passive: true });
    }
    const reset = element('button', 'viewer-button', 'Reset view');
    reset.type = 'button';
    reset.addEventListener('click', () => this.reset());
    const panel = element('div', 'viewer-panel');
    const keys: [string, string][] = [['dot', 'marker seen now, coloured by its sigma'], ['ring', 'marker known'], ['edge', 'edge measured'], ['gap', 'gap'], ['head', 'head']];
    for (const [kind, text] of keys) {
      const entry = element('span', `key ${kind}`, text);
      panel.append(entry);
    }
    panel.append(reset);
    this.host.replaceChildren(stage.element, panel);
    stage.start();
  }

  private index(): number {
    return this.scene?.points.findIndex((point) => point.id === this.selected) ?? -1;
  }

  private key(key: string): boolean {
    const points = this.scene?.points ?? [];
    if ((key === 'PageDown' || key === 'PageUp') && points.length > 0) {
      const at = this.index();
      const by = key === 'PageDown' ? 1 : -1;
      this.select((at + by + points.length + (at < 0 && by < 0 ? 1 : 0)) % points.length);
    } else if (key === 'Escape') {
      this.select(-1);
    } else if (key === '0') {
      this.reset();
    } else {
      return false;
    }
    return true;
  }

  private select(index: number): void {
    const point = this.scene?.points[index];
    this.selected = point?.id ?? '';
    this.tellSelected();
    this.stage?.render();
  }

  private tellSelected(): void {
    const lines = this.scene?.points[this.index()]?.about ?? [];
    const text = lines.join('\n');
    if (this.about.dataset['text'] === text) return;
    this.about.dataset['text'] = text;
    this.about.replaceChildren(...lines.map((line, i) => element(i === 0 ? 'strong' : 'span', '', line)));
  }

  private reset(): void {
    this.touched = false;
    if (this.scene) this.stage?.fit(this.places, this.scene.up, this.scene.towards, 0.35);
  }

  /** Fetches the scene when the state tells of a newer one. */
  update(state: State): void {
    const gaps = byId('gaps');
    show(gaps, state.gaps !== null);
    if (state.gaps) {
      const { count: many, length_mm, coverage } = state.gaps;
      gaps.dataset['level'] = many > 0 ? 'warning' : 'ok';
      say(gaps, many > 0
        ? `${count(many, 'gap')}, ${fixed(length_mm, 0)} mm in all; ${fixed(100 * coverage, 1)} % of the edge is covered`
        : `No gap: ${fixed(100 * coverage, 1)} % of the edge is covered`);
    }
    if (this.shown !== state.scene_version && !this.busy && performance.now() > this.retryAt) void this.load(state.scene_version);
  }

  /** The program was started anew: its versions begin again. */
  forget(): void {
    this.shown = -1;
    this.retryAt = 0;
    this.etag = '';
  }

  private async load(version: number): Promise<void> {
    this.busy = true;
    this.retryAt = performance.now() + 2000;
    try {
      const answer = await fetch('/scene', { headers: this.etag ? { 'If-None-Match': this.etag } : {} });
      if (answer.ok) {
        const space = (await answer.json()) as Space;
        this.etag = answer.headers.get('ETag') ?? '';
        this.draw(space);
      }
      if (answer.ok || answer.status === 304) {
        this.shown = version;
        this.retryAt = performance.now() + 500;
      }
    } catch {
      // Asked again with one of the next states, not before 2 s.
    } finally {
      this.busy = false;
    }
  }

  private draw(space: Space): void {
    say(byId('space-frame'), space.frame ? `in the frame of the ${space.frame}` : '');
    const live = space.markers.filter((marker) => marker.live).length;
    const patches = space.patches.length > 0 ? `${count(space.patches.length, 'scanned patch', 'scanned patches')} (${space.patches.map((one) => one.station).join(', ')})` : 'nothing scanned yet';
    say(byId('space-text'), `${count(space.markers.length, 'marker')}, ${live} of them seen now; ${patches}. Markers: sigma 0 (blue) to ${fixed(sigmaRange(space), 3)} mm (red).`);
    if (!this.stage) return;
    const scene = reportScene(space);
    const clouds = space.patches.map((one) => ({ points: decodePoints(one.points), colour: one.colour }));
    this.places = [
      ...scene.points.map((point) => point.p),
      ...space.rim.flatMap((piece) => piece.xyz_mm),
      ...(space.head ? [space.head.position_mm] : []),
      ...clouds.flatMap((cloud) => some(cloud.points)),
    ].filter((place) => place.every(Number.isFinite));
    const size = extent(this.places);

    for (const old of this.drawn) this.remove(old);
    const markersOnly = { ...scene, points: scene.points.slice(0, space.markers.length) };
    this.drawn = [
      ...clouds.map((cloud) => patch(cloud.points, cloud.colour)),
      ...space.rim.filter((piece) => piece.xyz_mm.length > 1).map((piece) => rim(piece, size)),
      makePoints(markersOnly),
    ];
    if (scene.cameras.length > 0) this.drawn.push(makeCameras(scene, size / 12));
    this.stage.world.add(...this.drawn);
    this.scene = scene;
    this.labels?.layer.remove();
    this.labels = new Labels(scene);
    this.stage.element.append(this.labels.layer);
    this.tellSelected();
    if (this.frame !== space.frame) this.touched = false;
    this.frame = space.frame;
    if (this.touched || this.places.length === 0) this.stage.render();
    else this.reset();
  }

  private remove(old: Object3D): void {
    this.stage?.world.remove(old);
    if (!(old instanceof Points || old instanceof LineSegments || old instanceof Line2)) return;
    old.geometry.dispose();
    for (const material of [old.material].flat()) (material as Material).dispose();
  }
}

/** A few points of a cloud: enough to look at all of it. */
function some(points: Float32Array): Triple[] {
  const every = 3 * Math.max(1, Math.ceil(points.length / 3 / 300));
  const places: Triple[] = [];
  for (let i = 0; i + 2 < points.length; i += every) places.push([points[i]!, points[i + 1]!, points[i + 2]!]);
  return places;
}

/** Diagonal of the box about all places, mm; 1000 where there are none. */
function extent(places: readonly Triple[]): number {
  if (places.length < 2) return 1000;
  const span = (i: number) => places.reduce((most, place) => Math.max(most, place[i]!), -Infinity) - places.reduce((least, place) => Math.min(least, place[i]!), Infinity);
  return Math.hypot(span(0), span(1), span(2)) || 1000;
}
