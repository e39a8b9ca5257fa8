// Bundles the viewer into one file: node build.mjs dist/viewer.js
import { readFileSync, writeFileSync } from 'node:fs';
import { build } from 'esbuild';

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
  banner: { js: `/* crosstie viewer, Apache-2.0. Contains three.js:\n${licence}\n*/` },
});

// The reports are well-formed XML too: the script stands in a CDATA section, whose end must not appear in it.
let text = result.outputFiles[0].text.replaceAll(']]>', ']] >');
if (/<\/script|<!--/i.test(text)) throw new Error('the bundle would end its script element early');
writeFileSync(process.argv[2], text);
