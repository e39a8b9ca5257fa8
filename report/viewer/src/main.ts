import type { Scene } from './scene';
import { View } from './view';

for (const host of document.querySelectorAll<HTMLElement>('[data-scene]')) {
  try {
    const text = document.getElementById(host.dataset['scene'] ?? '')?.textContent ?? '';
    const scene = JSON.parse(text) as Scene;
    if (scene.points.length > 0) new View(host, scene);
  } catch {
    const message = document.createElement('p');
    message.textContent = 'This browser offers no WebGL, which the 3D view needs. The plan views show the same points.';
    host.replaceChildren(message);
  }
}
