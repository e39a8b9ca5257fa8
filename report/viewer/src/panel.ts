import { colourOf } from './colour';
import type { Scene } from './scene';

export interface PanelEvents {
  magnify(magnification: number): void;
  show(what: 'labels' | 'cameras' | 'rays' | 'ellipsoids' | 'arrows', visible: boolean): void;
  reset(): void;
}

function element<K extends keyof HTMLElementTagNameMap>(tag: K, className: string, text = ''): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  made.className = className;
  if (text) made.textContent = text;
  return made;
}

/** 1, 2, 5, 10, ... times the scene's own magnification. */
function steps(scene: Scene): number[] {
  const base = Math.max(1, scene.magnification);
  const list: number[] = [];
  for (let exponent = -2; exponent <= 2; exponent++) {
    for (const mantissa of [1, 2, 5]) list.push(mantissa * 10 ** exponent * base);
  }
  return list.filter((value) => value >= 1 && value <= 100 * base);
}

function legend(scene: Scene): HTMLElement {
  const box = element('div', 'viewer-legend');
  const bar = document.createElement('canvas');
  bar.width = 160;
  bar.height = 10;
  const context = bar.getContext('2d');
  for (let x = 0; context && x < bar.width; x++) {
    context.fillStyle = `#${colourOf(x / (bar.width - 1)).getHexString()}`;
    context.fillRect(x, 0, 1, bar.height);
  }
  bar.setAttribute('aria-hidden', 'true');
  const format = (value: number) => Number(value.toPrecision(3)).toString();
  box.append(
    element('span', '', scene.legend.label),
    element('span', 'viewer-number', format(scene.legend.min)),
    bar,
    element('span', 'viewer-number', format(scene.legend.max) + (scene.legend.open ? ' and more' : '')),
  );
  return box;
}

/** The controls under the view. They are made here, so that a page without JavaScript shows none. */
export function makePanel(scene: Scene, events: PanelEvents): HTMLElement {
  const panel = element('div', 'viewer-panel');
  const values = steps(scene);
  const slider = element('input', '');
  slider.type = 'range';
  slider.min = '0';
  slider.max = String(values.length - 1);
  const nearest = values.reduce((best, value, i) =>
    Math.abs(Math.log(value / scene.magnification)) < Math.abs(Math.log(values[best]! / scene.magnification)) ? i : best, 0);
  slider.value = String(nearest);
  const factor = element('output', 'viewer-number');
  const tell = () => {
    const value = values[Number(slider.value)] ?? scene.magnification;
    factor.textContent = `\u00d7 ${Number(value.toPrecision(3))}`;
    slider.setAttribute('aria-valuetext', `${Number(value.toPrecision(3))} times`);
    events.magnify(value);
  };
  slider.addEventListener('input', tell);
  const label = element('label', 'viewer-slider');
  const hasArrows = scene.points.some((point) => point.d);
  label.append(element('span', '', hasArrows ? 'Magnification' : 'Ellipsoids (1 sigma)'), slider, factor);
  const hasEllipsoids = scene.points.some((point) => point.axes.length > 0);
  if (hasArrows || hasEllipsoids) panel.append(label);

  const toggle = (text: string, what: Parameters<PanelEvents['show']>[0], on: boolean) => {
    const box = element('input', '');
    box.type = 'checkbox';
    box.checked = on;
    box.addEventListener('change', () => events.show(what, box.checked));
    const wrap = element('label', 'viewer-toggle');
    wrap.append(box, element('span', '', text));
    panel.append(wrap);
  };
  if (scene.points.some((point) => point.id)) toggle('Ids', 'labels', true);
  if (scene.cameras.length > 0) toggle('Cameras', 'cameras', true);
  if (scene.cameras.length > 0) toggle('All rays', 'rays', false);
  if (hasArrows) toggle('Deviations', 'arrows', true);
  if (hasEllipsoids) toggle('Ellipsoids', 'ellipsoids', true);
  const reset = element('button', 'viewer-button', 'Reset view');
  reset.type = 'button';
  reset.addEventListener('click', () => events.reset());
  panel.append(reset, element('span', 'viewer-note', 'A click on a point tells its value and sigma'), legend(scene));
  if (scene.points.some((point) => point.ring)) panel.append(element('span', 'viewer-note', `Rings: ${scene.rings ?? 'targets without a code'}`));
  tell();
  return panel;
}
