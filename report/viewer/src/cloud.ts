import { BufferAttribute, BufferGeometry, type Camera, Matrix4, Points, ShaderMaterial, Vector3 } from 'three';
import { colourOf } from './colour';
import type { Scene, Triple } from './scene';

const floatsOfPoint = 5; // x y z less the centre, value, sigma
const shades = 256;
const inFrontPx = 5; // of all points this near to the pointer the one in front is meant

/** Points by the hundred thousand: one array from the report to the graphics card, without an object for each. */
export class Cloud {
  readonly points: Points;
  private readonly floats: Float32Array;
  private readonly centre: Triple;
  readonly count: number;

  constructor(private readonly scene: Scene) {
    const cloud = scene.cloud!;
    this.centre = cloud.centre;
    this.floats = floatsOf(cloud.data);
    this.count = Math.floor(this.floats.length / floatsOfPoint);
    this.points = this.make();
    this.points.position.set(...this.centre);
    this.points.frustumCulled = false;
  }

  private at(i: number, k: number): number {
    return this.floats[i * floatsOfPoint + k]!;
  }

  place(i: number): Triple {
    return [this.at(i, 0) + this.centre[0], this.at(i, 1) + this.centre[1], this.at(i, 2) + this.centre[2]];
  }

  about(i: number): string[] {
    const cloud = this.scene.cloud!;
    const digits = (value: number) => Number(value.toPrecision(2)).toString();
    const lines = [`${this.place(i).map((x) => x.toFixed(2)).join(' ')} mm`];
    const value = this.at(i, 3);
    if (cloud.value) lines.push(Number.isFinite(value) ? `${cloud.value} ${digits(value)} ${cloud.unit}`.trim() : cloud.none);
    const sigma = this.at(i, 4);
    return Number.isFinite(sigma) ? [...lines, `${cloud.sigma} ${digits(sigma)} ${cloud.sigma_unit}`] : lines;
  }

  /** Some of the places, of all parts of the cloud. */
  some(most: number): Triple[] {
    const every = Math.max(1, Math.ceil(this.count / most));
    const list: Triple[] = [];
    for (let i = 0; i < this.count; i += every) list.push(this.place(i));
    return list;
  }

  /** Index of the point drawn nearest to a pixel, -1 if none is within `radius_px`; what is nearest hides what lies behind. */
  nearest(camera: Camera, width: number, height: number, x: number, y: number, radius_px: number): { index: number; away: number } {
    const view = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    view.multiply(new Matrix4().makeTranslation(...this.centre));
    const m = view.elements;
    let best = { index: -1, away: radius_px, depth: Infinity };
    for (let i = 0, at = 0; i < this.count; i++, at += floatsOfPoint) {
      const a = this.floats[at]!;
      const b = this.floats[at + 1]!;
      const c = this.floats[at + 2]!;
      const w = m[3]! * a + m[7]! * b + m[11]! * c + m[15]!;
      if (!(w > 0)) continue;
      const away = Math.hypot(
        (((m[0]! * a + m[4]! * b + m[8]! * c + m[12]!) / w) * 0.5 + 0.5) * width - x,
        (-((m[1]! * a + m[5]! * b + m[9]! * c + m[13]!) / w) * 0.5 + 0.5) * height - y,
      );
      if (away >= radius_px) continue;
      const front = away < inFrontPx && best.away < inFrontPx ? w < best.depth : away < best.away;
      if (front) best = { index: i, away, depth: w };
    }
    return best;
  }

  private make(): Points {
    const { min, max } = this.scene.legend;
    const table = Array.from({ length: shades }, (_, i) => colourOf(i / (shades - 1)).toArray());
    const grey = [0.42, 0.45, 0.5];
    const colours = new Float32Array(3 * this.count);
    const places = new Float32Array(3 * this.count);
    for (let i = 0; i < this.count; i++) {
      const value = this.at(i, 3);
      const share = max > min ? Math.min(1, Math.max(0, (value - min) / (max - min))) : 0;
      const colour = Number.isFinite(value) ? table[Math.round(share * (shades - 1))]! : grey;
      for (let k = 0; k < 3; k++) {
        colours[3 * i + k] = colour[k]!;
        places[3 * i + k] = this.at(i, k);
      }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(places, 3));
    geometry.setAttribute('tint', new BufferAttribute(colours, 3));
    const dot = this.count > 60000 ? 2 : this.count > 10000 ? 3 : 5;
    const material = new ShaderMaterial({
      uniforms: { size: { value: dot * Math.min(2, window.devicePixelRatio) } },
      vertexShader: `
        attribute vec3 tint;
        uniform float size;
        varying vec3 colour;
        void main() {
          colour = tint;
          gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
          gl_PointSize = size;
        }`,
      fragmentShader: `
        varying vec3 colour;
        void main() {
          gl_FragColor = vec4(colour, 1.0);
          #include <colorspace_fragment>
        }`,
    });
    return new Points(geometry, material);
  }
}

function floatsOf(base64: string): Float32Array {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new Float32Array(bytes.buffer, 0, Math.floor(bytes.length / 4));
}

export function farthest(places: readonly Triple[]): number {
  const centre = new Vector3();
  for (const place of places) centre.addScaledVector(new Vector3(...place), 1 / places.length);
  return places.reduce((radius, place) => Math.max(radius, centre.distanceTo(new Vector3(...place))), 1);
}
