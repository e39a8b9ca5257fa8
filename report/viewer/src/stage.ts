import { AmbientLight, DirectionalLight, PerspectiveCamera, Scene as World, Vector3, WebGLRenderer } from 'three';
import { TrackballControls } from 'three/examples/jsm/controls/TrackballControls.js';
import { themeColour } from './colour';
import type { Triple } from './scene';

export interface StageEvents {
  /** After each drawing: labels are placed. */
  drawn(camera: PerspectiveCamera, width: number, height: number): void;
  /** A click that was not a turn, in pixels of the stage. */
  tapped(x: number, y: number): void;
  /** A key that the stage itself does not know; true if it was used. */
  key(key: string): boolean;
  /** Light became dark or the other way round. */
  themed(): void;
}

/** A canvas with a camera that mouse, touch and keys turn about a target. Throws where the browser offers no WebGL. */
export class Stage {
  readonly world = new World();
  readonly camera = new PerspectiveCamera(35, 1, 1, 1e7);
  readonly element = document.createElement('div');
  private readonly renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  private readonly controls: TrackballControls;
  private readonly lamp = new DirectionalLight(0xffffff, 2.0);

  constructor(label: string, private readonly events: StageEvents) {
    this.element.className = 'viewer-stage';
    this.element.tabIndex = 0;
    this.element.setAttribute('role', 'application');
    this.element.setAttribute('aria-label', label);
    this.element.append(this.renderer.domElement);
    this.world.add(new AmbientLight(0xffffff, 1.6), this.lamp);
    this.world.background = themeColour('--surface', '#ffffff');
    this.controls = new TrackballControls(this.camera, this.element);
    this.controls.rotateSpeed = 3;
    this.controls.staticMoving = true;
    this.controls.keys = ['', '', ''];
    this.controls.addEventListener('change', () => this.render());
    this.controls.addEventListener('start', () => requestAnimationFrame(() => this.follow()));
    this.element.addEventListener('wheel', () => requestAnimationFrame(() => this.controls.update()), { passive: true });
    this.listen();
  }

  /** Follows the size of its element from now on, and the theme. */
  start(): void {
    new ResizeObserver(() => this.resize()).observe(this.element);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      this.world.background = themeColour('--surface', '#ffffff');
      this.events.themed();
    });
    this.resize();
  }

  get width(): number {
    return this.element.clientWidth;
  }

  get height(): number {
    return this.element.clientHeight;
  }

  private listen(): void {
    let down: [number, number] | undefined;
    this.element.addEventListener('pointerdown', (event) => {
      down = [event.offsetX, event.offsetY];
    });
    this.element.addEventListener('pointerup', (event) => {
      if (down && Math.hypot(event.offsetX - down[0], event.offsetY - down[1]) < 4) this.events.tapped(event.offsetX, event.offsetY);
      down = undefined;
    });
    this.element.addEventListener('keydown', (event) => {
      if (!event.ctrlKey && !event.altKey && !event.metaKey && (this.key(event.key) || this.events.key(event.key))) event.preventDefault();
    });
  }

  /** While a button is down the trackball is asked for its motion at every frame, and not otherwise. */
  private follow(): void {
    let idle = 0;
    const step = () => {
      this.controls.update();
      if (idle++ < 4 || this.element.matches(':active')) requestAnimationFrame(step);
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

  /**
   * Looks along `towards`, `slant` from the side, from as near as all places can be seen.
   */
  fit(places: readonly Triple[], up: Triple, along: Triple, slant: number): void {
    const towards = new Vector3(...along).normalize();
    this.camera.up.set(...up).normalize();
    const aside = new Vector3().crossVectors(this.camera.up, towards).normalize();
    const from = towards.clone().multiplyScalar(-1).addScaledVector(aside, slant).addScaledVector(this.camera.up, 0.35).normalize();
    const right = new Vector3().crossVectors(this.camera.up, from).normalize();
    const above = new Vector3().crossVectors(from, right);

    const seen = places.map((place) => new Vector3(...place)).map((p) => new Vector3(p.dot(right), p.dot(above), p.dot(from)));
    if (seen.length === 0) return;
    const low = seen.reduce((a, b) => a.clone().min(b));
    const high = seen.reduce((a, b) => a.clone().max(b));
    const middle = low.clone().add(high).multiplyScalar(0.5);
    const tanY = 0.86 * Math.tan((this.camera.fov / 2) * (Math.PI / 180));
    const tanX = (tanY * this.width) / Math.max(1, this.height);
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
    const width = Math.max(1, this.width);
    const height = Math.max(1, this.height);
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.controls.handleResize();
    this.render();
  }

  still(): void {
    const picture = document.createElement('img');
    picture.src = this.renderer.domElement.toDataURL('image/png');
    picture.alt = '3D view';
    this.renderer.domElement.replaceWith(picture);
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  render(): void {
    this.camera.lookAt(this.controls.target);
    this.lamp.position.copy(this.camera.position);
    this.renderer.render(this.world, this.camera);
    this.events.drawn(this.camera, this.width, this.height);
  }
}

/** Index of the place drawn nearest to a pixel of the stage, or -1 if none is within `radius_px`. */
export function nearest(stage: Stage, places: readonly Triple[], x: number, y: number, radius_px: number): number {
  let best = -1;
  let distance = radius_px;
  places.forEach((place, i) => {
    const seen = new Vector3(...place).project(stage.camera);
    const away = Math.hypot((seen.x * 0.5 + 0.5) * stage.width - x, (-seen.y * 0.5 + 0.5) * stage.height - y);
    if (seen.z < 1 && away < distance) {
      distance = away;
      best = i;
    }
  });
  return best;
}
