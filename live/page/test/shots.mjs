// Pictures of every scripted state, to be looked at: node test/shots.mjs FOLDER [state ...]
import { mkdirSync } from 'node:fs';
import { openPage, sizes } from './browser.mjs';
import { MockServer } from './mock_server.mjs';
import { states } from './states.mjs';

const [folder, ...wanted] = process.argv.slice(2);
mkdirSync(folder, { recursive: true });
const server = await new MockServer().start();
for (const [size, viewport] of Object.entries(sizes)) {
  const { page, close } = await openPage(server, { viewport });
  for (const [name, state] of Object.entries(states)) {
    if (wanted.length > 0 && !wanted.includes(name)) continue;
    server.show(state);
    await page.waitForTimeout(900);
    await page.screenshot({ path: `${folder}/${name}-${size}.png` });
    await page.screenshot({ path: `${folder}/${name}-${size}-all.png`, fullPage: true });
    if (size === 'wide' && name === 'scan-done') await page.pdf({ path: `${folder}/${name}.pdf`, format: 'A4', printBackground: true });
  }
  await close();
}
await server.stop();
