// Bundles the operator's page into one file: node build.mjs dist/index.html
import { createHash } from 'node:crypto';
import { readFileSync, writeFileSync } from 'node:fs';
import { resolve } from 'node:path';
import { build } from 'esbuild';

const report = '../../report';
const licence = readFileSync('node_modules/three/LICENSE', 'utf8').trim();
const result = await build({
  entryPoints: ['src/main.ts'],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2020',
  charset: 'ascii',
  legalComments: 'none',
  write: false,
  // The viewer of the reports finds the same three.js.
  alias: { three: resolve('node_modules/three') },
  banner: { js: `/* crosstie live, Apache-2.0. Contains three.js:\n${licence}\n*/` },
});
const script = result.outputFiles[0].text;
if (/<\/script|<!--/i.test(script)) throw new Error('the bundle would end its script element early');

// One look for all: the colours and the 3D view are those of the reports.
const look = readFileSync(`${report}/assets/page.css`, 'utf8');
const colours = look.match(/:root \{[^}]*\}/)?.[0];
const viewer = look.split('\n').filter((line) => line.startsWith('.viewer'));
if (!colours || viewer.length === 0) throw new Error('report/assets/page.css has no colours or no styles of the viewer');
const style = [colours, ...viewer, readFileSync('src/page.css', 'utf8')].join('\n');
if (/<\/style/i.test(style)) throw new Error('the style sheet would end its element early');

const hash = (text) => `'sha256-${createHash('sha256').update(text, 'utf8').digest('base64')}'`;
const policy = [
  "default-src 'none'",
  "img-src 'self'",
  "connect-src 'self'",
  `script-src ${hash(script)}`,
  `style-src ${hash(style)}`,
  "base-uri 'none'",
  "form-action 'none'",
  "require-trusted-types-for 'script'",
  "trusted-types 'none'",
].join('; ');

let page = readFileSync('src/index.html', 'utf8');
for (const [mark, text] of [['%POLICY%', policy], ['%STYLE%', style], ['%SCRIPT%', script]]) {
  if (page.split(mark).length !== 2) throw new Error(`src/index.html must hold ${mark} once`);
  page = page.replace(mark, () => text);
}
writeFileSync(process.argv[2], page);
