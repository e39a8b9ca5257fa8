// The page in a real browser, against the mock server: what is pressed, posted, said and shown.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { after, before, beforeEach, describe, test } from 'node:test';
import { openPage, sizes } from './browser.mjs';
import { MockServer } from './mock_server.mjs';
import { base, camera, hostile, states, stations } from './states.mjs';

const axe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
let server;
let opened = [];
const open = async (options) => {
  const made = await openPage(server, options);
  opened.push(made);
  await made.page.waitForFunction(() => !document.documentElement.classList.contains('old') && document.querySelectorAll('.stage').length > 0);
  return made;
};
const until = async (what, holds, ms = 15000) => {
  const end = Date.now() + ms;
  while (!holds()) {
    assert.ok(Date.now() < end, `waited in vain: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
};
const shown = (page, text) => page.waitForFunction((wanted) => document.getElementById('instruction').textContent === wanted, text);
const put = async (page, state) => {
  const marked = { ...state, time: `${state.time} ${Math.random()}` };
  server.show(marked);
  await page.waitForFunction((time) => document.getElementById('foot').textContent.endsWith(time), marked.time);
};

before(async () => {
  server = await new MockServer().start();
});
after(async () => server.stop());
beforeEach(() => {
  server.posts.length = 0;
  server.paths.length = 0;
  server.sceneVersions.length = 0;
  server.refuse = null;
  server.silentCameras = false;
  server.state = base();
});
const closing = async () => {
  for (const one of opened) await one.close();
  opened = [];
};

describe('commands', { concurrency: false }, () => {
  test('the wanted part of the image is marked in that camera alone', async (t) => {
    t.after(closing);
    const { page } = await open();
    const marked = () => page.$$eval('#board-grids .wanted-cell', (cells) => cells.map((one) => one.getAttribute('visibility')));
    await put(page, { ...states.calibrate, board: { ...states.calibrate.board, cell: [7, 0], cell_side: 'right' } });
    assert.deepEqual(await marked(), ['hidden', 'visible']);
    await put(page, { ...states.calibrate, board: { ...states.calibrate.board, cell: [0, 5], cell_side: 'left' } });
    assert.deepEqual(await marked(), ['visible', 'hidden']);
    await put(page, { ...states.calibrate, board: { ...states.calibrate.board, cell: null, cell_side: 'left' } });
    assert.deepEqual(await marked(), ['hidden', 'hidden']);
  });

  test('the mouse posts exactly what the contract says', async (t) => {
    t.after(closing);
    const { page, complaints } = await open();
    await put(page, { ...base(), can: { next: true, repeat: true, undo: true, finish: true, cancel: true, check: true }, work: { what: 'scan', stage: 'decoding', done: 1, total: 3, seconds: 1 } });
    const press = async (selector, wanted) => {
      server.posts.length = 0;
      await page.click(selector);
      await until(selector, () => server.posts.length > 0);
      assert.deepEqual(server.posts, [wanted]);
    };
    for (const deed of ['next', 'repeat', 'undo', 'finish', 'cancel', 'check', 'reconnect']) await press(`#${deed}`, { command: deed });
    await press('.stage:not([aria-current])', { command: 'stage', name: 'calibrate' });
    await press('#stations-rows tr:nth-child(4) button', { command: 'select', station: 'x1250' });
    await page.fill('#axis-input', ' 850,04 ');
    await press('#axis-button', { command: 'axis', position_mm: 850.04 });
    await page.fill('#exposure-input', '12.5');
    await page.fill('#gain-input', '3');
    await press('#exposure', { command: 'exposure', exposure_s: 0.0125, gain: 3 });
    assert.deepEqual(complaints, []);
  });

  test('keys: Enter and Space on the focus, N R U anywhere, none while typing, none when switched off', async (t) => {
    t.after(closing);
    const { page } = await open();
    const gives = async (act, wanted) => {
      server.posts.length = 0;
      await page.waitForTimeout(650);
      await act();
      await page.waitForTimeout(200);
      assert.deepEqual(server.posts, wanted);
    };
    await page.focus('#next');
    await gives(() => page.keyboard.press('Enter'), [{ command: 'next' }]);
    await gives(() => page.keyboard.press('Space'), [{ command: 'next' }]);
    await page.focus('#undo');
    await gives(() => page.keyboard.press('Enter'), [{ command: 'undo' }]);
    await gives(() => page.keyboard.press('n'), [{ command: 'next' }]);
    await gives(() => page.keyboard.press('R'), [{ command: 'repeat' }]);
    await gives(() => page.keyboard.press('u'), [{ command: 'undo' }]);
    await gives(() => page.keyboard.press('Control+u'), []);
    await page.focus('#axis-input');
    await gives(() => page.keyboard.type('nru'), []);
    await gives(() => page.keyboard.press('Enter'), []);
    assert.match(await page.textContent('#axis-error'), /Type a number/);
    await page.fill('#axis-input', '-12.5');
    await gives(() => page.keyboard.press('Enter'), [{ command: 'axis', position_mm: -12.5 }]);
    await page.uncheck('#shortcuts');
    await gives(() => page.keyboard.press('n'), []);
    assert.equal(await page.isVisible('#next kbd'), false);
    await page.check('#shortcuts');
    await gives(() => page.keyboard.press('n'), [{ command: 'next' }]);
  });

  test('a bouncing press and a key held down are one command', async (t) => {
    t.after(closing);
    const { page } = await open();
    await page.dblclick('#next');
    await page.waitForTimeout(300);
    assert.deepEqual(server.posts, [{ command: 'next' }]);
    await page.waitForTimeout(650);
    await page.focus('#next');
    for (let i = 0; i < 12; i++) {
      await page.keyboard.down('Enter');
      await page.waitForTimeout(80);
    }
    await page.keyboard.up('Enter');
    await page.keyboard.down('n');
    for (let i = 0; i < 9; i++) await page.keyboard.down('n');
    assert.deepEqual(server.posts, [{ command: 'next' }, { command: 'next' }, { command: 'next' }]);
  });

  test('a button that may not be pressed says why, posts nothing and keeps the focus', async (t) => {
    t.after(closing);
    const { page } = await open();
    await page.focus('#next');
    await put(page, states['commission-missing']);
    assert.equal(await page.textContent('#next-why'), 'marker 17 is not seen');
    assert.equal(await page.getAttribute('#next', 'aria-disabled'), 'true');
    assert.equal(await page.evaluate(() => document.activeElement.id), 'next');
    await page.keyboard.press('Enter');
    await page.keyboard.press('n');
    await page.click('#finish', { force: true });
    await page.waitForTimeout(200);
    assert.deepEqual(server.posts, []);
    assert.match(await page.textContent('#spoken'), /9 stations are needed/);
    assert.equal(await page.textContent('#needed-text'), 'Needed 5, seen 4');
    assert.equal(await page.textContent('#needed-missing'), 'Missing: 17');
    await put(page, base());
    assert.equal(await page.getAttribute('#next', 'aria-disabled'), null);
    assert.equal(await page.evaluate(() => document.activeElement.id), 'finish');
  });

  test('a refusal is shown in the words of the program, as text', async (t) => {
    t.after(closing);
    const { page } = await open();
    server.refuse = [409, `the beam moved ${hostile}`];
    await page.click('#next');
    await page.waitForSelector('#answer:not([hidden])');
    assert.ok((await page.textContent('#answer')).includes(`the beam moved ${hostile}`));
    server.refuse = null;
    await page.waitForTimeout(650);
    await page.click('#next');
    await page.waitForSelector('#answer', { state: 'hidden' });
  });
});

describe('token', { concurrency: false }, () => {
  test('leaves the address line, lives as long as the window, and without it the page only watches', async (t) => {
    t.after(closing);
    const { page } = await open();
    assert.equal(page.url(), server.url);
    await page.reload();
    await page.waitForSelector('#next:not([aria-disabled])');
    await page.click('#next');
    await until('next after a reload', () => server.posts.length === 1);

    const other = await open({ token: false });
    await other.page.waitForSelector('#watching:not([hidden])');
    assert.match(await other.page.textContent('#next-why'), /watching only/);
    await other.page.click('#next', { force: true });
    await other.page.click('.stage:not([aria-current])', { force: true });
    await other.page.click('#stations-rows button', { force: true });
    await other.page.waitForTimeout(200);
    assert.equal(server.posts.length, 1);
    await other.page.evaluate((token) => {
      location.hash = token;
    }, server.token);
    await other.page.waitForSelector('#watching', { state: 'hidden' });
    assert.equal(other.page.url(), server.url);
    await other.page.click('#next');
    await until('next with the token typed in', () => server.posts.length === 2);
  });

  test('one that the program does not know ends in watching only', async (t) => {
    t.after(closing);
    const { page } = await open();
    server.token = 'another-token-987654321';
    t.after(() => {
      server.token = 'test-token-0123456789';
    });
    await page.click('#next');
    await page.waitForSelector('#watching:not([hidden])');
    assert.match(await page.textContent('#answer'), /started anew/);
    assert.equal(await page.evaluate(() => sessionStorage.length), 0);
    assert.deepEqual(server.posts, []);
  });
});

describe('connection', { concurrency: false }, () => {
  test('is found again after the program was started anew, with state, pictures and scene', async (t) => {
    t.after(closing);
    const { page } = await open();
    await until('both cameras', () => server.cameraClients === 2);
    const port = server.port;
    await server.stop();
    await page.waitForSelector('#lost:not([hidden])');
    assert.match(await page.textContent('#lost'), /Connection lost.*is old/);
    assert.equal(await page.textContent('#next-why'), 'not connected');
    await page.waitForTimeout(1500);
    server.state = { ...base(), instruction: 'Begun anew.' };
    await server.start(port);
    server.paths.length = 0;
    await shown(page, 'Begun anew.');
    assert.equal(await page.isVisible('#lost'), false);
    await until('both cameras again', () => server.cameraClients === 2);
    await until('the scene again', () => server.paths.includes('GET /scene'));
    await page.waitForSelector('#next:not([aria-disabled])');
  });

  test('a picture stream that ends, or stands still, begins again by itself', async (t) => {
    t.after(closing);
    const { page } = await open();
    let frames = 2000;
    const running = setInterval(() => server.show({ ...base(), cameras: [camera('left', { frames: (frames += 2) }), camera('right', { frames })] }), 100);
    t.after(() => clearInterval(running));
    await until('both cameras', () => server.cameraClients === 2);
    await page.waitForFunction(() => [...document.images].every((image) => image.naturalWidth === 612));
    await page.waitForTimeout(1500);
    server.dropCameras();
    assert.equal(server.cameraClients, 0);
    await until('streams again', () => server.cameraClients === 2, 20000);
    server.paths.length = 0;
    server.silentCameras = true;
    await until('streams that stand still are asked anew', () => server.paths.includes('GET /camera/left') && server.paths.includes('GET /camera/right'), 20000);
    server.silentCameras = false;
  });

  test('a camera that comes back gets its picture back', async (t) => {
    t.after(closing);
    const { page } = await open();
    await put(page, states['camera-lost']);
    assert.match(await page.textContent('.camera[data-running="no"]'), /is the cable in\?.*This camera does not run/);
    assert.ok(await page.isVisible('#reconnect-now'));
    server.paths.length = 0;
    await put(page, base());
    await until('the right camera', () => server.paths.includes('GET /camera/right'));
    assert.equal(await page.isVisible('#reconnect-now'), false);
  });

  test('asks for the scene only when it is newer', async (t) => {
    t.after(closing);
    const { page } = await open();
    await page.waitForTimeout(900);
    const count = () => server.paths.filter((path) => path === 'GET /scene').length;
    const begun = count();
    assert.ok(begun >= 1);
    for (let i = 0; i < 20; i++) await put(page, base());
    assert.equal(count(), begun);
    await put(page, states.scan);
    await until('the newer scene', () => count() === begun + 1);
  });
});

describe('what is shown', { concurrency: false }, () => {
  test('ten states a second touch only what changes: focus, selection and typed text stay', async (t) => {
    t.after(closing);
    const { page } = await open();
    await page.fill('#axis-input', '123');
    await page.evaluate(() => {
      const range = document.createRange();
      range.selectNodeContents(document.getElementById('instruction'));
      document.activeElement.blur();
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      window.changes = [];
      const watch = (id) => new MutationObserver((list) => window.changes.push(...list.map(() => id))).observe(document.getElementById(id), { subtree: true, childList: true, characterData: true, attributes: true });
      ['instruction', 'buttons', 'stages', 'stations-rows', 'markers-rows', 'log', 'drift', 'verdicts-rows', 'space'].forEach(watch);
    });
    for (let i = 0; i < 30; i++) await put(page, { ...base(), cameras: [camera('left', { frames: 3000 + i }), camera('right', { frames: 3000 + i })] });
    assert.deepEqual(await page.evaluate(() => window.changes), []);
    assert.equal(await page.evaluate(() => getSelection().toString()), base().instruction);
    assert.equal(await page.inputValue('#axis-input'), '123');
    assert.match(await page.textContent('.camera'), /3029 frames/);
  });

  test('the log grows by what is new, also when old lines go', async (t) => {
    t.after(closing);
    const { page } = await open();
    const line = (i) => ({ time: '11:20:03', level: 'info', text: `line ${i}` });
    await put(page, { ...base(), log: Array.from({ length: 100 }, (_, i) => line(i)) });
    await page.evaluate(() => {
      window.added = [];
      new MutationObserver((list) => list.forEach((one) => one.addedNodes.forEach((node) => window.added.push(node.textContent)))).observe(document.getElementById('log'), { childList: true });
    });
    await put(page, { ...base(), log: Array.from({ length: 100 }, (_, i) => line(i + 2)) });
    assert.deepEqual(await page.evaluate(() => window.added), ['11:20:03line 100', '11:20:03line 101']);
    assert.equal(await page.evaluate(() => document.getElementById('log').children.length), 100);
  });

  test('numbers, tables and words', async (t) => {
    t.after(closing);
    const { page } = await open();
    await put(page, states['scan-done']);
    const text = (selector) => page.evaluate((wanted) => [...document.querySelectorAll(wanted)].map((one) => one.innerText.trim().replace(/\s+/g, ' ')), selector);
    assert.deepEqual(await text('#markers-rows tr:nth-child(4) > *'), ['21', 'doubtful', 'both', '986.50', '1213.91', '185.02', '0.021 0.048 0.019', '4.2 !']);
    assert.equal(await page.textContent('#markers-frame'), 'in the frame of the machine');
    assert.deepEqual(await text('#verdicts-rows tr:nth-child(2) > *'), ['! Warning', 'edge_sigma_mm', '0.110 mm', '0.100 mm', 'accuracy asked for: 0.3 mm, a third of it']);
    assert.deepEqual(await page.evaluate(() => [...document.querySelectorAll('#reports a')].map((link) => link.getAttribute('href'))),
      ['/results/index.html', '/results/calibrate/report.html', '/results/commission/report.html', '/results/scan/report.html']);
    assert.match(await page.textContent('#axis'), /1450\.02 mm.*LinuxCNC, just now/);
    assert.equal(await page.isVisible('#axis-form'), false);
    assert.match(await page.getAttribute('.histogram', 'aria-label'), /median \d+ % of white, 0\.1 % saturated, 2\.0 % dark/);
    assert.match(await page.getAttribute('#drift svg', 'aria-label'), /5 stations, 0\.029 to 0\.045 px/);
    await put(page, states.calibrate);
    assert.match(await page.getAttribute('.coverage >> nth=0', 'aria-label'), /33 of 48 parts of the image covered$/);
    assert.match(await page.getAttribute('.coverage >> nth=1', 'aria-label'), /of 48 parts.*wanted: column 8, row 1/);
    await put(page, states['commission-missing']);
    assert.match(await page.textContent('#axis-age'), /typed in, 2 min ago, too old/);
    await put(page, states['scan-working']);
    assert.match(await page.innerText('#work'), /scan x1050 decoding\s+3 of 18, \d+ s/);
    assert.equal(await page.getAttribute('#work-bar', 'value'), '3');
  });

  test('hostile strings are text, hostile links are none', async (t) => {
    t.after(closing);
    const { page, complaints, requests } = await open();
    await put(page, states.hostile);
    await page.waitForTimeout(900);
    assert.equal(await page.evaluate(() => window.hacked), undefined);
    assert.equal(await page.evaluate(() => document.querySelectorAll('main img').length), 2);
    assert.equal(await page.evaluate(() => document.scripts.length), 1);
    assert.equal(await page.textContent('#instruction'), hostile);
    assert.equal(await page.evaluate(() => document.querySelectorAll('#reports a').length), 0);
    assert.deepEqual(complaints, []);
    assert.ok(requests.every((url) => url.startsWith(server.url)));
  });

  test('the page asks no one else, and its policy forbids it', async (t) => {
    t.after(closing);
    const { page, complaints, requests } = await open();
    for (const state of Object.values(states)) await put(page, state);
    await page.waitForTimeout(900);
    assert.ok(requests.length > 4);
    assert.deepEqual(requests.filter((url) => !url.startsWith(server.url)), []);
    assert.deepEqual(complaints, []);
    const html = readFileSync(new URL('../dist/index.html', import.meta.url), 'utf8');
    assert.doesNotMatch(html.split('<script>')[0] + html.split('</script>')[1], /\sstyle=|\son\w+=/);
    assert.match(html, /default-src 'none'; img-src 'self'; connect-src 'self'; script-src 'sha256-[^;]+'; style-src 'sha256-/);
    const blocked = await page.evaluate(async () => {
      try {
        await fetch('http://127.0.0.1:1/');
        return 'went out';
      } catch {
        return new Promise((resolve) => {
          document.addEventListener('securitypolicyviolation', (event) => resolve(event.violatedDirective), { once: true });
          fetch('http://127.0.0.1:2/').catch(() => undefined);
        });
      }
    });
    assert.equal(blocked, 'connect-src');
  });

  test('the 3D view draws markers, patches, edge and gap', async (t) => {
    t.after(closing);
    const { page, complaints } = await open();
    await put(page, states.scan);
    await until('the scene', () => server.sceneVersions.includes(9));
    await page.waitForTimeout(1200);
    const colours = await page.evaluate(() => {
      const view = document.querySelector('.viewer-stage canvas');
      const copy = document.createElement('canvas');
      copy.width = view.width;
      copy.height = view.height;
      const context = copy.getContext('2d');
      context.drawImage(view, 0, 0);
      const { data } = context.getImageData(0, 0, copy.width, copy.height);
      const found = { blue: 0, red: 0, green: 0, white: 0, all: data.length / 4 };
      for (let i = 0; i < data.length; i += 4) {
        const [r, g, b] = data.slice(i, i + 3);
        if (r > 240 && g > 240 && b > 240) found.white++;
        if (b > r + 60 && b > g + 30) found.blue++;
        if (r > 120 && g < 50 && b < 50) found.red++;
        if (g > r + 40 && g > b + 30 && r < 60) found.green++;
      }
      return found;
    });
    assert.ok(colours.blue > 500 && colours.red > 60 && colours.green > 200 && colours.white > 0.4 * colours.all, JSON.stringify(colours));
    const labels = await page.evaluate(() => [...document.querySelectorAll('.viewer-labels span')].map((one) => one.textContent));
    assert.ok(labels.includes('17') && labels.includes('gap'));
    await page.focus('.viewer-stage');
    await page.keyboard.press('PageDown');
    assert.match(await page.textContent('.viewer-about'), /Marker 3, seen now/);
    assert.match(await page.textContent('#gaps'), /1 gap, 83 mm in all; 96\.0 %/);
    assert.deepEqual(complaints, []);
  });

  test('without WebGL the rest works and the page says so', async (t) => {
    t.after(closing);
    const { page, complaints } = await open({
      before: ['const get = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind.startsWith("webgl") ? null : get.call(this, kind, ...rest); };'],
    });
    await put(page, states.scan);
    assert.match(await page.textContent('#space'), /offers no WebGL/);
    await page.waitForFunction(() => /12 markers, 6 of them seen now/.test(document.getElementById('space-text').textContent));
    await page.click('#next');
    await until('next', () => server.posts.length === 1);
    assert.deepEqual(complaints, []);
  });
});

/** Main controls: inside the page, not over each other, their text not cut. */
function layout() {
  const faults = [];
  const root = document.documentElement;
  if (root.scrollWidth > root.clientWidth) faults.push(`page is ${root.scrollWidth} wide, window ${root.clientWidth}`);
  const visible = (one) => one.checkVisibility({ visibilityProperty: true }) && one.getBoundingClientRect().width > 1;
  const boxes = [...document.querySelectorAll('button, input, .picture, #instruction, .card, .legend, .fact, .losses, .why')].filter(visible).filter((one) => !one.closest('.table, .log'));
  for (const one of boxes) {
    const box = one.getBoundingClientRect();
    const name = one.id || `${one.className} ${one.textContent.slice(0, 20)}`;
    if (box.left < -0.5 || box.right > root.clientWidth + 0.5) faults.push(`${name} leaves the page`);
    if (!one.matches('input, .picture') && one.scrollWidth > one.clientWidth + 1 && getComputedStyle(one).display !== 'inline') faults.push(`${name} is cut: ${one.scrollWidth} > ${one.clientWidth}`);
    if (one.matches('button') && one.scrollHeight > one.clientHeight + 1) faults.push(`${name} is cut in height`);
    for (const other of boxes) {
      if (one === other || one.contains(other) || other.contains(one)) continue;
      const far = other.getBoundingClientRect();
      if (Math.min(box.right, far.right) - Math.max(box.left, far.left) > 1 && Math.min(box.bottom, far.bottom) - Math.max(box.top, far.top) > 1) faults.push(`${name} lies over ${other.id || other.className}`);
    }
  }
  for (const id of ['next', 'repeat', 'undo']) {
    const { height, width } = document.getElementById(id).getBoundingClientRect();
    if (height < 64 || width < 64) faults.push(`${id} is small: ${width} x ${height}`);
  }
  return faults;
}

for (const [size, viewport] of Object.entries(sizes)) {
  describe(`every state, ${viewport.width} px`, { concurrency: false }, () => {
    let made;
    before(async () => {
      server.state = base();
      made = await openPage(server, { viewport, before: [axe] });
      await made.page.waitForFunction(() => document.querySelectorAll('.stage').length > 0);
    });
    after(async () => made.close());
    for (const [name, state] of Object.entries(states)) {
      test(name, async () => {
        const { page } = made;
        await put(page, state);
        await page.waitForTimeout(300);
        assert.deepEqual(await page.evaluate(layout), []);
        const found = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ['violations'] }));
        const faults = found.violations.map((one) => `${one.impact} ${one.id}: ${one.nodes.map((node) => `${node.target} ${node.failureSummary}`).slice(0, 3).join(' | ')}`);
        assert.deepEqual(faults, []);
        if (size === 'wide' && ['calibrate', 'commission', 'scan', 'scan-working', 'scan-done'].includes(name)) {
          const low = await page.evaluate(() => [...document.querySelectorAll('#buttons, .picture, .losses, .side .card')].filter((one) => one.checkVisibility()).map((one) => [one.id || one.className, one.getBoundingClientRect().bottom]).filter(([, bottom]) => bottom > innerHeight));
          assert.ok(await page.evaluate(() => [...document.querySelectorAll('.table')].every((one) => one.scrollWidth <= one.clientWidth)), 'tables fit');
          assert.deepEqual(low, [], 'the main things stand in the first screen');
        }
      });
    }
  });
}

test('stations of another stage keep their rows', async (t) => {
  t.after(closing);
  const { page } = await open();
  await page.focus('#stations-rows tr:nth-child(3) button');
  await put(page, { ...base(), stations: stations(3, 'commission') });
  assert.equal(await page.evaluate(() => document.activeElement.textContent), 'x1050');
});
