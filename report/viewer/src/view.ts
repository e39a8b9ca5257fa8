import { type BufferGeometry, type LineSegments, type Material, Vector3 } from 'three';
import { Cloud, farthest } from './cloud';
import { Labels } from './labels';
import { makeAllRays, makeArrows, makeBars, makeCameras, makeEllipsoids, makePoints, makeRays } from './objects';
import { makePanel } from './panel';
import type { Scene, Triple } from './scene';
import { Stage, nearest } from './stage';

const pickRadiusPx = 14;
const placesToFit = 4000;

export class View {
  private readonly stage: Stage;
  private readonly labels: Labels;
  private readonly ellipsoids: ReturnType<typeof makeEllipsoids> | undefined;
  private readonly cloud: Cloud | undefined;
  private readonly about = document.createElement('div');
  private readonly mark = document.createElement('div');
  private cameras: LineSegments | undefined;
  private bars: LineSegments | undefined;
  private arrows: LineSegments | undefined;
  private rays: LineSegments | undefined;
  private allRays: LineSegments | undefined;
  private showCameras = true;
  private showRays = false;
  private showArrows = true;
  private selected = -1;
  private radius = 1;

  constructor(host: HTMLElement, private readonly scene: Scene) {
    this.about.className = 'viewer-about';
    this.about.setAttribute('role', 'status');
    this.labels = new Labels(scene);
    this.stage = new Stage(
      '3D view. Arrow keys turn, plus and minus zoom, n and p step through the points, Escape deselects, 0 resets.', {
        drawn: (camera, width, height) => {
          this.labels.place(camera, width, height, this.selected);
          this.placeMark(width, height);
        },
        tapped: (x, y) => this.select(this.pointAt(x, y)),
        key: (key) => this.key(key),
        themed: () => this.themed(),
      });
    this.mark.className = 'viewer-mark';
    this.mark.hidden = true;
    this.stage.element.append(this.labels.layer, this.mark, this.about);
    if (scene.cloud) this.cloud = new Cloud(scene);
    if (this.cloud) this.stage.world.add(this.cloud.points);
    if (scene.points.length > 0) this.stage.world.add(makePoints(scene));
    if (scene.points.some((point) => point.axes.length > 0)) this.ellipsoids = makeEllipsoids(scene);
    if (this.ellipsoids) this.stage.world.add(this.ellipsoids.mesh);
    this.radius = farthest(this.places());
    const panel = makePanel(scene, {
      magnify: (value) => this.magnify(value),
      show: (what, visible) => this.show(what, visible),
      reset: () => this.reset(),
    });
    host.replaceChildren(this.stage.element, panel);
    this.themed();
    this.reset();
    this.stage.start();
  }

  /** Points, and as many of the cloud as tell its extent. */
  private places(): Triple[] {
    return [...this.scene.points.map((point) => point.p), ...(this.cloud?.some(placesToFit) ?? [])];
  }

  /** Those of the cloud come after the named ones. */
  private get count(): number {
    return this.scene.points.length + (this.cloud?.count ?? 0);
  }

  private placeOf(index: number): Triple {
    return this.scene.points[index]?.p ?? this.cloud!.place(index - this.scene.points.length);
  }

  private pointAt(x: number, y: number): number {
    const named = nearest(this.stage, this.scene.points.map((point) => point.p), x, y, pickRadiusPx);
    if (named >= 0 || !this.cloud) return named;
    const found = this.cloud.nearest(this.stage.camera, this.stage.width, this.stage.height, x, y, pickRadiusPx);
    return found.index < 0 ? -1 : found.index + this.scene.points.length;
  }

  private placeMark(width: number, height: number): void {
    this.mark.hidden = this.selected < 0;
    if (this.selected < 0) return;
    const at = new Vector3(...this.placeOf(this.selected)).project(this.stage.camera);
    this.mark.style.transform = `translate(${((at.x * 0.5 + 0.5) * width).toFixed(1)}px, ${((-at.y * 0.5 + 0.5) * height).toFixed(1)}px)`;
  }

  /** A picture in place of the view: for paper, where nothing turns, and a browser keeps only so many views. */
  still(): void {
    this.stage.still();
  }

  private key(key: string): boolean {
    if (key === 'n' || key === 'p') this.step(key === 'n' ? 1 : -1);
    else if (key === 'Escape') this.select(-1);
    else if (key === '0') this.reset();
    else return false;
    return true;
  }

  private step(by: number): void {
    const count = this.count;
    if (count > 0) this.select((this.selected + by + count + (this.selected < 0 && by < 0 ? 1 : 0)) % count);
  }

  private select(index: number): void {
    this.selected = index;
    this.rays = this.exchange(this.rays, index >= 0 ? makeRays(this.scene, index) : undefined);
    const named = this.scene.points[index];
    const about = named?.about ?? (index < 0 ? [] : this.cloud!.about(index - this.scene.points.length));
    this.about.replaceChildren(...about.map((line, i) => {
      const made = document.createElement(i === 0 ? 'strong' : 'span');
      made.textContent = line;
      return made;
    }));
    this.stage.render();
  }

  private exchange(old: LineSegments | undefined, made: LineSegments | undefined): LineSegments | undefined {
    if (old) {
      this.stage.world.remove(old);
      (old.geometry as BufferGeometry).dispose();
      (old.material as Material).dispose();
    }
    if (made) this.stage.world.add(made);
    return made;
  }

  private magnify(value: number): void {
    this.ellipsoids?.place(value);
    this.arrows = this.exchange(this.arrows, makeArrows(this.scene, value));
    this.arrows!.visible = this.showArrows;
    this.stage.render();
  }

  private show(what: 'labels' | 'cameras' | 'rays' | 'ellipsoids' | 'arrows', visible: boolean): void {
    if (what === 'labels') this.labels.layer.hidden = !visible;
    if (what === 'ellipsoids' && this.ellipsoids) this.ellipsoids.mesh.visible = visible;
    if (what === 'cameras') this.showCameras = visible;
    if (what === 'arrows') this.showArrows = visible;
    if (what === 'rays') this.drawRays(visible);
    if (this.cameras) this.cameras.visible = this.showCameras;
    if (this.arrows) this.arrows.visible = this.showArrows;
    this.stage.render();
  }

  private drawRays(visible: boolean): void {
    this.showRays = visible;
    this.allRays = this.exchange(this.allRays, visible ? makeAllRays(this.scene) : undefined);
  }

  private themed(): void {
    this.cameras = this.exchange(this.cameras, makeCameras(this.scene, this.pyramidDepth()));
    this.cameras!.visible = this.showCameras;
    this.bars = this.exchange(this.bars, makeBars(this.scene));
    this.drawRays(this.showRays);
    this.select(this.selected);
  }

  private pyramidDepth(): number {
    return 0.12 * this.radius;
  }

  /** Looks at the points from the side that the report names, as near as all of points and cameras can be seen. */
  private reset(): void {
    const places = [...this.places(), ...this.scene.cameras.map((camera) => camera.centre)];
    this.stage.fit(places, this.scene.up, this.scene.towards, this.scene.cameras.length > 0 ? 0.9 : 0.35);
  }
}
