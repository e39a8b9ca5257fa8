import {
  AmbientLight,
  type BufferGeometry,
  DirectionalLight,
  type LineSegments,
  type Material,
  PerspectiveCamera,
  Scene as World,
  Vector2,
  Vector3,
  WebGLRenderer,
} from 'three';
import { TrackballControls } from 'three/examples/jsm/controls/TrackballControls.js';
import { themeColour } from './colour';
import { Labels } from './labels';
import { makeAllRays, makeArrows, makeBars, makeCameras, makeEllipsoids, makePoints, makeRays } from './objects';
import { makePanel } from './panel';
import type { Scene, Triple } from './scene';

const pickRadiusPx = 14;

export class View {
  private readonly world = new World();
  private readonly camera = new PerspectiveCamera(35, 1, 1, 1e7);
  private readonly renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  private readonly controls: TrackballControls;
  private readonly labels: Labels;
  private readonly ellipsoids: ReturnType<typeof makeEllipsoids>;
  private readonly about = document.createElement('div');
  private readonly stage = document.createElement('div');
  private readonly lamp = new DirectionalLight(0xffffff, 2.0);
  private cameras: LineSegments | undefined;
  private bars: LineSegments | undefined;
  private arrows: LineSegments | undefined;
  private rays: LineSegments | undefined;
  private allRays: LineSegments | undefined;
  private showCameras = true;
  private showRays = false;
  private showArrows = true;
  private selected = -1;
  private readonly centre = new Vector3();
  private radius = 1;

  constructor(host: HTMLElement, private readonly scene: Scene) {
    this.stage.className = 'viewer-stage';
    this.stage.tabIndex = 0;
    this.stage.setAttribute('role', 'application');
    this.stage.setAttribute('aria-label',
      '3D view. Arrow keys turn, plus and minus zoom, n and p step through the points, Escape deselects, 0 resets.');
    this.about.className = 'viewer-about';
    this.about.setAttribute('role', 'status');
    this.labels = new Labels(scene);
    this.stage.append(this.renderer.domElement, this.labels.layer, this.about);
    this.ellipsoids = makeEllipsoids(scene);
    this.world.add(new AmbientLight(0xffffff, 1.6), this.lamp, makePoints(scene), this.ellipsoids.mesh);
    this.measure();
    this.controls = new TrackballControls(this.camera, this.stage);
    this.controls.rotateSpeed = 3;
    this.controls.staticMoving = true;
    this.controls.keys = ['', '', ''];
    this.controls.addEventListener('change', () => this.render());
    this.controls.addEventListener('start', () => requestAnimationFrame(() => this.follow()));
    this.stage.addEventListener('wheel', () => requestAnimationFrame(() => this.controls.update()), { passive: true });
    this.listen();
    const panel = makePanel(scene, {
      magnify: (value) => this.magnify(value),
      show: (what, visible) => this.show(what, visible),
      reset: () => this.reset(),
    });
    host.replaceChildren(this.stage, panel);
    this.themed();
    this.reset();
    new ResizeObserver(() => this.resize()).observe(this.stage);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.themed());
    this.resize();
  }

  private measure(): void {
    for (const point of this.scene.points) this.centre.addScaledVector(new Vector3(...point.p), 1 / this.scene.points.length);
    for (const point of this.scene.points) this.radius = Math.max(this.radius, this.centre.distanceTo(new Vector3(...point.p)));
  }

  private listen(): void {
    let down: [number, number] | undefined;
    this.stage.addEventListener('pointerdown', (event) => {
      down = [event.offsetX, event.offsetY];
    });
    this.stage.addEventListener('pointerup', (event) => {
      if (down && Math.hypot(event.offsetX - down[0], event.offsetY - down[1]) < 4) this.pick(event.offsetX, event.offsetY);
      down = undefined;
    });
    this.stage.addEventListener('keydown', (event) => {
      if (this.key(event.key)) event.preventDefault();
    });
  }

  /** While a button is down the trackball is asked for its motion at every frame, and not otherwise. */
  private follow(): void {
    let idle = 0;
    const step = () => {
      this.controls.update();
      if (idle++ < 4 || this.stage.matches(':active')) requestAnimationFrame(step);
    };
    step();
  }

  private key(key: string): boolean {
    const turn = Math.PI / 24;
    if (key === 'ArrowLeft') this.turn(this.camera.up, -turn);
    else if (key === 'ArrowRight') this.turn(this.camera.up, turn);
    else if (key === 'ArrowUp') this.turn(this.sideways(), -turn);
    else if (key === 'ArrowDown') this.turn(this.sideways(), turn);
    else if (key === '+' || key === '=') this.zoom(0.85);
    else if (key === '-') this.zoom(1 / 0.85);
    else if (key === 'n' || key === 'p') this.step(key === 'n' ? 1 : -1);
    else if (key === 'Escape') this.select(-1);
    else if (key === '0') this.reset();
    else return false;
    return true;
  }

  private sideways(): Vector3 {
    return new Vector3().subVectors(this.camera.position, this.controls.target).cross(this.camera.up).normalize();
  }

  private turn(axis: Vector3, angle: number): void {
    const unit = axis.clone().normalize();
    const arm = new Vector3().subVectors(this.camera.position, this.controls.target).applyAxisAngle(unit, angle);
    this.camera.up.applyAxisAngle(unit, angle);
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.render();
  }

  private zoom(factor: number): void {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.render();
  }

  private step(by: number): void {
    const count = this.scene.points.length;
    if (count > 0) this.select((this.selected + by + count + (this.selected < 0 && by < 0 ? 1 : 0)) % count);
  }

  private pick(x: number, y: number): void {
    const at = new Vector2(x, y);
    let best = -1;
    let distance = pickRadiusPx;
    this.scene.points.forEach((point, i) => {
      const seen = new Vector3(...point.p).project(this.camera);
      const on = new Vector2((seen.x * 0.5 + 0.5) * this.stage.clientWidth, (-seen.y * 0.5 + 0.5) * this.stage.clientHeight);
      if (seen.z < 1 && on.distanceTo(at) < distance) {
        distance = on.distanceTo(at);
        best = i;
      }
    });
    this.select(best);
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
    this.render();
  }

  private exchange(old: LineSegments | undefined, made: LineSegments | undefined): LineSegments | undefined {
    if (old) {
      this.world.remove(old);
      (old.geometry as BufferGeometry).dispose();
      (old.material as Material).dispose();
    }
    if (made) this.world.add(made);
    return made;
  }

  private magnify(value: number): void {
    this.ellipsoids.place(value);
    this.arrows = this.exchange(this.arrows, makeArrows(this.scene, value));
    this.arrows!.visible = this.showArrows;
    this.render();
  }

  private show(what: 'labels' | 'cameras' | 'rays' | 'ellipsoids' | 'arrows', visible: boolean): void {
    if (what === 'labels') this.labels.layer.hidden = !visible;
    if (what === 'ellipsoids') this.ellipsoids.mesh.visible = visible;
    if (what === 'cameras') this.showCameras = visible;
    if (what === 'arrows') this.showArrows = visible;
    if (what === 'rays') this.drawRays(visible);
    if (this.cameras) this.cameras.visible = this.showCameras;
    if (this.arrows) this.arrows.visible = this.showArrows;
    this.render();
  }

  private drawRays(visible: boolean): void {
    this.showRays = visible;
    this.allRays = this.exchange(this.allRays, visible ? makeAllRays(this.scene) : undefined);
  }

  private themed(): void {
    this.world.background = themeColour('--surface', '#ffffff');
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
    const towards = new Vector3(...(this.scene.towards as Triple)).normalize();
    this.camera.up.set(...(this.scene.up as Triple)).normalize();
    const aside = new Vector3().crossVectors(this.camera.up, towards).normalize();
    const slant = this.scene.cameras.length > 0 ? 0.9 : 0.35;
    const from = towards.clone().multiplyScalar(-1).addScaledVector(aside, slant).addScaledVector(this.camera.up, 0.35).normalize();
    const right = new Vector3().crossVectors(this.camera.up, from).normalize();
    const above = new Vector3().crossVectors(from, right);

    const places = [...this.scene.points.map((point) => point.p), ...this.scene.cameras.map((camera) => camera.centre)];
    const seen = places.map((place) => new Vector3(...place)).map((p) => new Vector3(p.dot(right), p.dot(above), p.dot(from)));
    const low = seen.reduce((a, b) => a.clone().min(b));
    const high = seen.reduce((a, b) => a.clone().max(b));
    const middle = low.clone().add(high).multiplyScalar(0.5);
    const tanY = 0.86 * Math.tan((this.camera.fov / 2) * (Math.PI / 180));
    const tanX = (tanY * this.stage.clientWidth) / Math.max(1, this.stage.clientHeight);
    let distance = 1;
    for (const p of seen) {
      const at = p.clone().sub(middle);
      distance = Math.max(distance, Math.abs(at.x) / tanX + at.z, Math.abs(at.y) / tanY + at.z);
    }
    const target = new Vector3()
      .addScaledVector(right, middle.x)
      .addScaledVector(above, middle.y)
      .addScaledVector(from, middle.z);
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(from, distance);
    this.camera.near = distance / 1000;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.render();
  }

  private resize(): void {
    const width = Math.max(1, this.stage.clientWidth);
    const height = Math.max(1, this.stage.clientHeight);
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.controls.handleResize();
    this.render();
  }

  private render(): void {
    this.camera.lookAt(this.controls.target);
    this.lamp.position.copy(this.camera.position);
    this.renderer.render(this.world, this.camera);
    this.labels.place(this.camera, this.stage.clientWidth, this.stage.clientHeight, this.selected);
  }
}
