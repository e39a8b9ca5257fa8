import {
  BufferAttribute,
  BufferGeometry,
  Color,
  InstancedMesh,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  MeshLambertMaterial,
  Points,
  ShaderMaterial,
  SphereGeometry,
  Vector3,
} from 'three';
import { colourOf, themeColour } from './colour';
import type { Scene, Triple } from './scene';

export function fractionOf(scene: Scene, value: number): number {
  const span = scene.legend.max - scene.legend.min;
  return span > 0 ? (value - scene.legend.min) / span : 0;
}

/** Round dots of constant size on the screen. */
export function makePoints(scene: Scene): Points {
  const geometry = new BufferGeometry();
  const colours = scene.points.flatMap((point) => colourOf(fractionOf(scene, point.value)).toArray());
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(scene.points.flatMap((point) => point.p)), 3));
  geometry.setAttribute('tint', new BufferAttribute(new Float32Array(colours), 3));
  geometry.setAttribute('ring', new BufferAttribute(new Float32Array(scene.points.map((point) => (point.ring ? 1 : 0))), 1));
  const material = new ShaderMaterial({
    uniforms: { size: { value: 9 * Math.min(2, window.devicePixelRatio) } },
    vertexShader: `
      attribute vec3 tint;
      attribute float ring;
      uniform float size;
      varying vec3 colour;
      varying float hole;
      void main() {
        colour = tint;
        hole = 0.26 * ring;
        gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        gl_PointSize = size;
      }`,
    fragmentShader: `
      varying vec3 colour;
      varying float hole;
      void main() {
        float r = length(gl_PointCoord - 0.5);
        if (r > 0.5 || r < hole) discard;
        gl_FragColor = vec4(colour * (r > 0.38 ? 0.55 : 1.0), 1.0);
        #include <colorspace_fragment>
      }`,
  });
  return new Points(geometry, material);
}

/** One ellipsoid per point; `place` sets their magnification. */
export function makeEllipsoids(scene: Scene): { mesh: InstancedMesh; place: (magnification: number) => void } {
  const material = new MeshLambertMaterial({ transparent: true, opacity: 0.55, depthWrite: false });
  const mesh = new InstancedMesh(new SphereGeometry(1, 24, 16), material, scene.points.length);
  mesh.frustumCulled = false;
  scene.points.forEach((point, i) => mesh.setColorAt(i, colourOf(fractionOf(scene, point.value))));
  const place = (magnification: number) => {
    scene.points.forEach((point, i) => {
      const a = point.axes.map((value) => value * magnification);
      const [x, y, z] = point.p;
      // prettier-ignore
      mesh.setMatrixAt(i, new Matrix4().set(
        a[0] ?? 0, a[3] ?? 0, a[6] ?? 0, x,
        a[1] ?? 0, a[4] ?? 0, a[7] ?? 0, y,
        a[2] ?? 0, a[5] ?? 0, a[8] ?? 0, z,
        0, 0, 0, 1));
    });
    mesh.instanceMatrix.needsUpdate = true;
  };
  return { mesh, place };
}

function segments(positions: number[], colours: number[]): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(positions), 3));
  geometry.setAttribute('color', new BufferAttribute(new Float32Array(colours), 3));
  const lines = new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }));
  lines.frustumCulled = false;
  return lines;
}

const groupVariables = ['--series-1', '--series-2', '--series-3', '--series-4', '--series-5', '--series-6'];

/** The pyramids of the cameras, `depth` mm high. */
export function makeCameras(scene: Scene, depth: number): LineSegments {
  const positions: number[] = [];
  const colours: number[] = [];
  for (const camera of scene.cameras) {
    const colour = themeColour(groupVariables[camera.group % groupVariables.length]!, '#888888');
    const centre = new Vector3(...camera.centre);
    const corners = camera.corners.map((corner) => new Vector3(...corner).multiplyScalar(depth).add(centre));
    corners.forEach((corner, i) => {
      const next = corners[(i + 1) % 4]!;
      positions.push(...centre.toArray(), ...corner.toArray(), ...corner.toArray(), ...next.toArray());
      for (let k = 0; k < 4; k++) colours.push(...colour.toArray());
    });
  }
  return segments(positions, colours);
}

export function makeBars(scene: Scene): LineSegments {
  const colour = themeColour('--series-2', '#d95f02');
  return segments(
    scene.bars.flatMap((bar) => [...bar.a, ...bar.b]),
    scene.bars.flatMap(() => [...colour.toArray(), ...colour.toArray()]),
  );
}

export function makeRays(scene: Scene, selected: number): LineSegments {
  const point = scene.points[selected];
  const colour = themeColour('--accent', '#3366cc');
  const positions: number[] = [];
  const colours: number[] = [];
  for (const camera of point?.seen ?? []) {
    positions.push(...scene.cameras[camera]!.centre, ...point!.p);
    colours.push(...colour.toArray(), ...colour.toArray());
  }
  return segments(positions, colours);
}

/** Every ray of every point: faint, since there are thousands. */
export function makeAllRays(scene: Scene): LineSegments {
  const colour = themeColour('--muted', '#888888');
  const positions: number[] = [];
  const colours: number[] = [];
  for (const point of scene.points) {
    for (const camera of point.seen) {
      positions.push(...scene.cameras[camera]!.centre, ...point.p);
      colours.push(...colour.toArray(), ...colour.toArray());
    }
  }
  const lines = segments(positions, colours);
  const material = lines.material as LineBasicMaterial;
  material.transparent = true;
  material.opacity = Math.max(0.04, Math.min(0.4, 250 / Math.max(1, positions.length / 6)));
  material.depthWrite = false;
  return lines;
}

/** Deviation arrows: a shaft and a four-sided head of lines, which stay visible at any zoom. */
export function makeArrows(scene: Scene, magnification: number): LineSegments {
  const positions: number[] = [];
  const colours: number[] = [];
  for (const point of scene.points) {
    if (!point.d) continue;
    const colour: Color = colourOf(fractionOf(scene, point.value));
    const from = new Vector3(...point.p);
    const shaft = new Vector3(...(point.d as Triple)).multiplyScalar(magnification);
    const length = shaft.length();
    if (!(length > 0)) continue;
    const to = from.clone().add(shaft);
    const along = shaft.clone().divideScalar(length);
    const helper = Math.abs(along.x) < 0.8 ? new Vector3(1, 0, 0) : new Vector3(0, 1, 0);
    const side = new Vector3().crossVectors(along, helper).normalize();
    const other = new Vector3().crossVectors(along, side);
    positions.push(...from.toArray(), ...to.toArray());
    const back = to.clone().addScaledVector(along, -0.25 * length);
    for (const [axis, sign] of [[side, 1], [side, -1], [other, 1], [other, -1]] as [Vector3, number][]) {
      positions.push(...to.toArray(), ...back.clone().addScaledVector(axis, sign * 0.12 * length).toArray());
    }
    for (let k = 0; k < 10; k++) colours.push(...colour.toArray());
  }
  return segments(positions, colours);
}
