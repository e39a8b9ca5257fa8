import { type BufferGeometry, type LineSegments, type Material, Vector3 } from 'three';
import { Labels } from './labels';
import { makeAllRays, makeArrows, makeBars, makeCameras, makeEllipsoids, makePoints, makeRays } from './objects';
import { makePanel } from './panel';
import type { Scene } from './scene';
import { Stage, nearest } from './stage';

const pickRadiusPx = 14;

export class View {
  private readonly stage: Stage;
  private readonly labels: Labels;
  private readonly ellipsoids: ReturnType<typeof makeEllipsoids>;
  private readonly about = document.createElement('div');
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
        drawn: (camera, width, height) => this.labels.place(camera, width, height, this.selected),
        tapped: (x, y) => this.select(nearest(this.stage, this.scene.points.map((point) => point.p), x, y, pickRadiusPx)),
        key: (key) => this.key(key),
        themed: () => this.themed(),
      });
    this.stage.element.append(this.labels.layer, this.about);
    this.ellipsoids = makeEllipsoids(scene);
    this.stage.world.add(makePoints(scene), this.ellipsoids.mesh);
    this.measure();
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

  private measure(): void {
    const centre = new Vector3();
    for (const point of this.scene.points) centre.addScaledVector(new Vector3(...point.p), 1 / this.scene.points.length);
    for (const point of this.scene.points) this.radius = Math.max(this.radius, centre.distanceTo(new Vector3(...point.p)));
  }

  private key(key: string): boolean {
    if (key === 'n' || key === 'p') this.step(key === 'n' ? 1 : -1);
    else if (key === 'Escape') this.select(-1);
    else if (key === '0') this.reset();
    else return false;
    return true;
  }

  private step(by: number): void {
    const count = this.scene.points.length;
    if (count > 0) this.select((this.selected + by + count + (this.selected < 0 && by < 0 ? 1 : 0)) % count);
  }

  private select(index: number): void {
    this.selected = index;
    this.rays = this.exchange(this.rays, index >= 0 ? makeRays(this.scene, index) : undefined);
    const point = this.scene.points[index];
    this.about.replaceChildren(...(point?.about ?? []).map((line, i) => {
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
    this.ellipsoids.place(value);
    this.arrows = this.exchange(this.arrows, makeArrows(this.scene, value));
    this.arrows!.visible = this.showArrows;
    this.stage.render();
  }

  private show(what: 'labels' | 'cameras' | 'rays' | 'ellipsoids' | 'arrows', visible: boolean): void {
    if (what === 'labels') this.labels.layer.hidden = !visible;
    if (what === 'ellipsoids') this.ellipsoids.mesh.visible = visible;
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
    const places = [...this.scene.points.map((point) => point.p), ...this.scene.cameras.map((camera) => camera.centre)];
    this.stage.fit(places, this.scene.up, this.scene.towards, this.scene.cameras.length > 0 ? 0.9 : 0.35);
  }
}
