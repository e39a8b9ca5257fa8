// The page of the real program, in a real browser, over GigE Vision against the digital twin: the whole of a commissioning by
// mouse and keyboard. What the page took must be worth what run makes of the same files. Takes minutes; npm run test:twin.
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { openPage } from './browser.mjs';

const program = process.env.CROSSTIE ?? 'crosstie';
const work = mkdtempSync(join(tmpdir(), 'crosstie-twin-'));
const job = join(work, 'segment');
const shots = process.env.CROSSTIE_SHOTS;
const latencies = { left: [], right: [] };
let server = null;
let opened = null;

/** The program, once it has printed the address of its page. */
async function start() {
  const child = spawn(program, ['live', job, '--twin', 'segment', '--port', '0'], { stdio: ['ignore', 'pipe', 'pipe'] });
  let errors = '';
  child.stderr.on('data', (text) => (errors += text));
  const ended = new Promise((resolve) => child.on('exit', (code, signal) => resolve(signal ?? code)));
  const address = await new Promise((resolve, reject) => {
    let text = '';
    child.stdout.on('data', (more) => {
      text += more;
      if (text.includes('\n')) resolve(text.trim());
    });
    ended.then((how) => reject(new Error(`crosstie live ended (${how}): ${errors}`)), reject);
  });
  const [url, token] = address.split('#');
  return { child, url, token, ended };
}

async function state() {
  return (await fetch(`${server.url}state`)).json();
}

async function until(what, holds, seconds = 120) {
  const end = Date.now() + seconds * 1000;
  for (;;) {
    const now = await state();
    for (const camera of now.cameras) if (camera.latency_ms !== null) latencies[camera.side].push(camera.latency_ms);
    if (holds(now)) return now;
    assert.ok(Date.now() < end, `waited in vain: ${what}; ${now.instruction} ${JSON.stringify(now.why_not)} ${JSON.stringify(now.log.slice(-3))}`);
    await new Promise((resolve) => setTimeout(resolve, 200));
  }
}

const stage = (now, name) => now.stages.find((one) => one.name === name);
const idle = (name) => (now) => now.stage === name && now.work === null;
const page = () => opened.page;
const canPress = (deed) => page().waitForFunction((id) => !document.getElementById(id).hasAttribute('aria-disabled'), deed, { timeout: 120000 });

async function shoot(name) {
  if (!shots) return;
  mkdirSync(shots, { recursive: true });
  await page().screenshot({ path: join(shots, `${name}.png`), fullPage: true });
}

/** Next by mouse or by key, until the stage has one more. */
async function take(name, have, key) {
  await until(`${name}: Next`, (now) => now.stage === name && now.can.next && stage(now, name).have === have, 240);
  await new Promise((resolve) => setTimeout(resolve, 1000));  // the board or the beam is at rest
  await canPress('next');
  if (key) await page().keyboard.press('n');
  else await page().click('#next');
  await until(`${name}: ${have + 1} taken`, (now) => stage(now, name).have === have + 1, 240);
}

async function finish(name) {
  await until(`${name}: Finish`, (now) => idle(name)(now) && now.can.finish, 240);
  await canPress('finish');
  await page().click('#finish');
  return until(`${name} done`, (now) => stage(now, name).state === 'done' && now.work === null, 400);
}

async function go(name, title) {
  await page().click(`.stage:has-text("${title}")`);
  await until(`stage ${name}`, idle(name));
}

const results = (folder) => readdirSync(join(folder, 'results'), { recursive: true }).map(String).filter((file) => file.endsWith('result.json')).sort();

after(async () => {
  await opened?.close();
  if (server) {
    server.child.kill('SIGKILL');
    await server.ended;
  }
  if (!process.env.CROSSTIE_KEEP) rmSync(work, { recursive: true, force: true });
});

test('the page calibrates, commissions and scans the twin, and run agrees', { timeout: 1150000 }, async () => {
  server = await start();
  opened = await openPage(server);

  let now = await until('the guide', idle('calibrate'));
  for (let pose = 0; pose < 28 && (pose < 25 || !now.can.finish || now.board.cell); pose++) {
    await take('calibrate', pose, pose % 2 === 1);
    now = await state();
    if (pose === 12) await shoot('calibrate');
  }
  await finish('calibrate');

  await go('commission', 'Commission');
  for (let station = 0; station < 5; station++) {
    await take('commission', station, station % 2 === 1);
    if (station === 2) await shoot('commission');
  }
  await finish('commission');
  await canPress('check');
  await page().click('#check');
  now = await until('the head check', (one) => one.health.level !== 'NONE' && one.work === null, 240);
  assert.equal(now.health.level, 'OK', now.health.text);

  await go('scan', 'Scan');
  await take('scan', 0, false);

  // One station is undone (its images are kept aside) and taken again.
  await canPress('undo');
  await page().keyboard.press('u');
  await until('undone', (one) => stage(one, 'scan').have === 0 && one.work === null, 240);
  assert.ok(readdirSync(join(job, 'undone')).length > 0);
  await take('scan', 0, true);

  // In the middle of the second: the page is loaded anew, and a second browser watches without a token.
  await until('the second station', (one) => one.can.next, 240);
  await canPress('next');
  await page().click('#next');
  await shoot('scanning');
  await page().reload({ waitUntil: 'domcontentloaded' });
  const second = await openPage(server, { token: false });
  try {
    await second.page.waitForSelector('#watching:not([hidden])');
    assert.equal(await second.page.getAttribute('#next', 'aria-disabled'), 'true');
    await second.page.keyboard.press('u');
    await until('the second station taken', (one) => stage(one, 'scan').have === 2, 240);
  } finally {
    await second.close();
  }

  // The program is killed, and goes on where it was.
  server.child.kill('SIGKILL');
  await server.ended;
  await opened.close();
  opened = null;
  server = await start();
  opened = await openPage(server);
  now = await until('the program anew', (one) => one.cameras.every((camera) => camera.running) && one.work === null);
  assert.deepEqual(now.stages.map((one) => one.have >= one.want || one.name === 'scan'), [true, true, true]);
  assert.equal(stage(now, 'scan').have, 2);
  if (now.stage !== 'scan') await go('scan', 'Scan');
  await take('scan', 2, false);
  now = await finish('scan');
  await page().waitForFunction(() => !document.getElementById('space-text').textContent.includes(' 0 '), null, { timeout: 10000 });
  await shoot('finished');
  assert.deepEqual(opened.complaints, []);
  for (const [side, all] of Object.entries(latencies)) {
    const sorted = all.sort((a, b) => a - b);
    console.log(`${side}: latency median ${sorted[sorted.length >> 1].toFixed(1)} ms, largest ${sorted.at(-1).toFixed(1)} ms of ${sorted.length}`);
  }
  for (const camera of now.cameras) console.log(`${camera.side}: ${camera.rate_hz} Hz, ${camera.frames} frames, ${camera.dropped} dropped, ${camera.lost} lost, ${camera.incomplete} incomplete`);

  // The same files, without results, by run.
  const copy = join(work, 'run', 'segment');
  cpSync(job, copy, { recursive: true, filter: (path) => path !== join(job, 'results') && path !== join(job, 'undone') });
  assert.ok(!existsSync(join(copy, 'results')));
  const ran = spawnSync(program, ['run', copy, '--quiet'], { encoding: 'utf8' });
  assert.equal(ran.status, 0, ran.stderr);
  const files = results(copy);
  assert.ok(files.length >= 7, files.join(' '));
  for (const file of files) {
    const [live, run] = [job, copy].map((folder) => JSON.parse(readFileSync(join(folder, 'results', file), 'utf8').replaceAll(folder, 'JOB')));
    assert.deepEqual(live, run, file);
  }
});
