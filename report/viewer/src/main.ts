import type { Scene } from './scene';
import { View } from './view';

for (const host of document.querySelectorAll<HTMLElement>('[data-scene]')) {
  try {
    const text = document.getElementById(host.dataset['scene'] ?? '')?.textContent ?? '';
    const scene = JSON.parse(text) as Scene;
    const view = scene.points.length > 0 || scene.cloud ? new View(host, scene) : undefined;
    if (document.documentElement.dataset['still']) view?.still();
  } catch {
    const message = document.createElement('p');
    message.textContent = 'This browser offers no WebGL, which the 3D view needs. The plan views show the same points.';
    host.replaceChildren(message);
  }
}
