import { type PerspectiveCamera, Vector3 } from 'three';
import type { Scene } from './scene';

const cellPx = 26;

/** Ids as text over the canvas; where they would cover each other only the first is shown. */
export class Labels {
  readonly layer = document.createElement('div');
  private readonly spans: HTMLSpanElement[] = [];

  constructor(private readonly scene: Scene) {
    this.layer.className = 'viewer-labels';
    this.layer.setAttribute('aria-hidden', 'true');
    for (const point of scene.points) {
      const span = document.createElement('span');
      span.textContent = point.id;
      this.layer.append(span);
      this.spans.push(span);
    }
  }

  place(camera: PerspectiveCamera, width: number, height: number, selected: number): void {
    if (this.layer.hidden) return;
    const taken = new Set<string>();
    const order = [...this.scene.points.keys()];
    if (selected >= 0 && selected < this.scene.points.length) order.unshift(selected);
    const done = new Set<number>();
    for (const i of order) {
      if (done.has(i)) continue;
      done.add(i);
      const at = new Vector3(...this.scene.points[i]!.p).project(camera);
      const x = (at.x * 0.5 + 0.5) * width;
      const y = (-at.y * 0.5 + 0.5) * height;
      const cell = `${Math.round(x / cellPx)},${Math.round(y / cellPx / 0.7)}`;
      const visible = at.z < 1 && x > 0 && x < width && y > 0 && y < height && !taken.has(cell);
      const span = this.spans[i]!;
      span.hidden = !visible;
      span.className = i === selected ? 'selected' : '';
      if (!visible) continue;
      taken.add(cell);
      span.style.transform = `translate(${(x + 7).toFixed(1)}px, ${(y - 14).toFixed(1)}px)`;
    }
  }
}
