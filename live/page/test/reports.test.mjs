// Every report of a job in a real browser, wide and narrow: nothing is asked of a network, cut, or out of reach of a screen reader, and the
// verdicts' numbers are those of result.json. The job is CROSSTIE_JOB, with its results; npm run test:reports.
import assert from 'node:assert/strict';
import { existsSync, readFileSync, readdirSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { describe, test } from 'node:test';
import { openPage, sizes } from './browser.mjs';

const axe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
const results = join(resolve(process.env.CROSSTIE_JOB ?? 'job'), 'results');
const reports = readdirSync(results, { recursive: true }).map(String).filter((file) => file.endsWith('.html')).sort();

/** What stands beyond the page's border, and texts of figures that leave their figure. */
function layout() {
  const faults = [];
  const width = document.documentElement.clientWidth;
  if (document.documentElement.scrollWidth > width) faults.push(`the page is ${document.documentElement.scrollWidth} wide`);
  for (const element of document.querySelectorAll('main *, header *, nav *')) {
    if (element.closest('.table, pre, svg, figure, .viewer-stage, nav ul')) continue;  // these scroll by themselves
    if (element.getBoundingClientRect().right > width + 1) faults.push(`${element.tagName}.${element.className} leaves the page`);
  }
  for (const svg of document.querySelectorAll('svg')) {
    const frame = svg.getBoundingClientRect();
    if (frame.width === 0) continue;
    for (const text of svg.querySelectorAll('text')) {
      const box = text.getBoundingClientRect();
      if (box.left < frame.left - 1 || box.right > frame.right + 1 || box.top < frame.top - 1 || box.bottom > frame.bottom + 1)
        faults.push(`"${text.textContent}" leaves ${svg.querySelector('title')?.textContent}`);
    }
  }
  return faults;
}

/** The rows of the verdicts' table: value and limit as they are sorted by. */
function judged() {
  const rows = [...document.querySelectorAll('#verdicts tbody tr')];
  return rows.map((row) => [...row.querySelectorAll('[data-v]')].map((cell) => Number(cell.dataset.v)));
}

test('a whole job has reports', () => assert.ok(reports.includes('index.html') && reports.length > 5, reports.join(' ')));

for (const [size, viewport] of Object.entries(sizes)) {
  describe(`reports, ${viewport.width} px`, { concurrency: false }, () => {
    for (const file of reports) {
      test(file, async () => {
        const server = { url: pathToFileURL(join(results, file)).href };
        const made = await openPage(server, { viewport, token: false, bypassCSP: true });
        try {
          const { page } = made;
          await page.evaluate(axe);
          assert.deepEqual(await page.evaluate(layout), []);
          const found = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ['violations'] }));
          const faults = found.violations.map((one) => `${one.impact} ${one.id}: ${one.nodes.slice(0, 3).map((node) => `${node.target} ${node.failureSummary}`).join(' | ')}`);
          assert.deepEqual(faults, []);
          assert.deepEqual(made.requests.filter((address) => !address.startsWith('file:') && !address.startsWith('data:') && !address.startsWith('blob:')), []);
          assert.deepEqual(made.complaints, []);
          const json = join(results, dirname(file), 'result.json');
          if (size === 'wide' && existsSync(json)) {
            const { verdicts } = JSON.parse(readFileSync(json, 'utf8'));
            const shown = await page.evaluate(judged);
            const told = Object.values(verdicts ?? []).map((verdict) => [verdict.value, verdict.limit]);
            assert.deepEqual(shown, told, 'verdicts are those of result.json');
          }
        } finally {
          await made.close();
        }
      });
    }
  });
}
