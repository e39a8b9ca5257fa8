// Every report of a job in a browser: node --test reports.test.mjs with JOB=<job folder> and MODULES=<folder whose node_modules holds
// playwright-core and axe-core>.
import assert from 'node:assert/strict';
import { existsSync, readFileSync, readdirSync, statSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join, relative } from 'node:path';
import { after, before, test } from 'node:test';
import { pathToFileURL } from 'node:url';

const require = createRequire(join(process.env.MODULES, 'package.json'));
const { chromium } = require('playwright-core');
const axe = readFileSync(require.resolve('axe-core/axe.min.js'), 'utf8');
const results = join(process.env.JOB, 'results');
const sizes = [{ width: 1280, height: 800 }, { width: 390, height: 844 }];
const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find((path) => existsSync(path));

function pagesIn(folder) {
  return readdirSync(folder).flatMap((name) => {
    const path = join(folder, name);
    return statSync(path).isDirectory() ? pagesIn(path) : name.endsWith('.html') ? [path] : [];
  });
}

let browser;
before(async () => {
  browser = await chromium.launch({ executablePath, args: ['--no-sandbox', '--enable-unsafe-swiftshader'] });
});
after(() => browser.close());

async function opened(file, viewport, work) {
  const context = await browser.newContext({ viewport });
  await context.addInitScript(axe);
  const page = await context.newPage();
  const complaints = [];
  page.on('console', (message) => {
    if (['error', 'warning'].includes(message.type()) && !/GL Driver Message/.test(message.text())) complaints.push(message.text());
  });
  page.on('pageerror', (error) => complaints.push(String(error)));
  page.on('request', (request) => {
    if (!/^(file|data|blob):/.test(request.url())) complaints.push(`asked for ${request.url()}`);
  });
  try {
    const start = performance.now();
    await page.goto(pathToFileURL(file).href);
    await work(page, performance.now() - start);
    assert.deepEqual(complaints, []);
  } finally {
    await context.close();
  }
}

/** What stands beyond the right edge and cannot be scrolled to inside of a table or a figure. */
function cut() {
  const width = document.documentElement.clientWidth;
  return [...document.querySelectorAll('header *, nav *, main *')]
    .filter((one) => !one.closest('.table, pre, figure, .viewer-stage') && one.getBoundingClientRect().right > width + 1)
    .map((one) => `${one.tagName} ${one.textContent.slice(0, 40)}`);
}

/** Texts of a drawing that leave it. */
function outside() {
  return [...document.querySelectorAll('svg')].flatMap((drawing) => {
    const box = drawing.getBoundingClientRect();
    return [...drawing.querySelectorAll('text')]
      .filter((text) => {
        const at = text.getBoundingClientRect();
        return at.left < box.left - 1 || at.right > box.right + 1 || at.top < box.top - 1 || at.bottom > box.bottom + 1;
      })
      .map((text) => `"${text.textContent}" of ${drawing.querySelector('title')?.textContent}`);
  });
}

// From a number as it is stored to the one that is read: per mille and per cent, micrometres, degrees, U.
const scales = [1, 1e3, 1e6, 1e2, 180 / Math.PI].flatMap((scale) => [scale, 2 * scale]);

/** Half a unit of the last digit of a number as it is written. */
function rounding(text) {
  const [, fraction = '', exponent = '0'] = /^-?\d+(?:\.(\d*))?(?:e([+-]?\d+))?$/.exec(text);
  return 0.5000001 * 10 ** (Number(exponent) - fraction.length);
}

function numbersOf(value, found = []) {
  if (typeof value === 'number') found.push(value);
  else if (value && typeof value === 'object') Object.values(value).forEach((one) => numbersOf(one, found));
  return found;
}

const pages = pagesIn(results);
assert.ok(pages.length >= 8, `${results}: not the reports of a whole job`);
for (const file of pages) {
  const name = relative(results, file);
  const overview = name === 'index.html';
  for (const viewport of sizes) {
    test(`${name} at ${viewport.width} px`, async () => {
      await opened(file, viewport, async (page, millis) => {
        assert.deepEqual(await page.evaluate(cut), []);
        assert.deepEqual(await page.evaluate(outside), []);
        const found = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ['violations'] }));
        assert.deepEqual(found.violations.map((one) => `${one.impact} ${one.id}: ${one.nodes[0].html}`), []);
        assert.ok(await page.locator('.banner strong').textContent());
        if (!overview) {
          const back = await page.locator('a.overview').getAttribute('href');
          assert.ok(existsSync(join(dirname(file), back)), `${back} is not there`);
        }
        if (process.env.TELL) console.log(`${name} ${viewport.width} px: ${millis.toFixed(0)} ms`);
      });
    });
  }

  test(`${name}: what is read is what is stored`, async () => {
    await opened(file, sizes[0], async (page) => {
      const cells = await page.$$eval('[data-v]', (all) => all.map((one) => ({ text: one.textContent.trim(), value: Number(one.dataset.v) })));
      for (const { text, value } of cells) {
        const read = text.replace(/[\u2009\u202f]/g, '').replace('\u2212', '-').replace(/^[\u2264\u2265<>]\s*/, '');
        if (!/^-?\d/.test(read) || /^</.test(text)) continue;
        const said = Number(read);
        const half = rounding(read);
        assert.ok(scales.some((scale) => Math.abs(said - scale * value) <= half + 1e-9 * Math.abs(said)), `reads ${text}, is ${value}`);
      }
      if (overview) return;
      const result = JSON.parse(readFileSync(join(dirname(file), 'result.json'), 'utf8'));
      const shown = await page.$$eval('#verdicts tbody tr', (rows) => rows.map((row) => ({
        level: row.cells[1].textContent, value: Number(row.cells[2].dataset.v), limit: Number(row.cells[3].dataset.v), unit: row.cells[4].textContent,
      })));
      assert.deepEqual(shown, result.verdicts.map(({ level, value, limit, unit }) => ({ level, value, limit, unit })));
      if (process.env.TELL) {
        const stored = new Set(numbersOf(result));
        const known = cells.filter(({ value }) => stored.has(value)).length;
        console.log(`${name}: ${known} of ${cells.length} cells stand in result.json`);
      }
    });
  });
}

const scans = pages.filter((file) => /"cloud":/.test(readFileSync(file, 'utf8')));
test('a point of a cloud tells its value and its sigma', async () => {
  assert.ok(scans.length > 0);
  for (const file of scans) {
    await opened(file, sizes[0], async (page) => {
      const stage = page.locator('.viewer-stage');
      await stage.scrollIntoViewIfNeeded();
      await stage.focus();
      await page.keyboard.press('n');
      assert.match(await page.locator('.viewer-about').textContent(), /mm/);
      await page.keyboard.press('Escape');
      assert.equal(await page.locator('.viewer-about').textContent(), '');
      const { width, height } = await stage.boundingBox();
      for (let i = 0; i < 60 && !(await page.locator('.viewer-about').textContent()); i++) {
        await stage.click({ position: { x: width * (0.3 + 0.04 * (i % 10)), y: height * (0.3 + 0.08 * Math.floor(i / 10)) } });
      }
      assert.match(await page.locator('.viewer-about').textContent(), /-?\d+\.\d\d -?\d+\.\d\d -?\d+\.\d\d mm.*sigma.* \d/);
    });
  }
});

test('without JavaScript every picture but the 3D view is there', async () => {
  const context = await browser.newContext({ javaScriptEnabled: false });
  const page = await context.newPage();
  for (const file of pages) {
    await page.goto(pathToFileURL(file).href);
    const words = await page.locator('body').innerText();
    assert.doesNotMatch(words, /<svg|<p class|&lt;/, relative(results, file));
  }
  await context.close();
});
