// Debian's chromium under playwright-core; each page keeps what it complained of and what it asked for.
import { existsSync } from 'node:fs';
import { chromium } from 'playwright-core';

export const executable = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find((path) => existsSync(path));
export const sizes = { wide: { width: 1280, height: 800 }, narrow: { width: 390, height: 844 } };

let browser = null;
let open = 0;

export async function openPage(server, { viewport = sizes.wide, token = true, flags = [], before = [] } = {}) {
  if (!executable) throw new Error('no chromium: apt-get install chromium');
  const own = flags.length > 0;
  const used = own ? await launch(flags) : (browser ??= await launch([]));
  open++;
  const context = await used.newContext({ viewport, reducedMotion: 'reduce' });
  for (const script of before) await context.addInitScript(script);
  const page = await context.newPage();
  const complaints = [];
  const requests = [];
  page.on('console', (message) => {
    // SwiftShader's remark on reading a canvas back is about this test, not about the page.
    if (/GL Driver Message/.test(message.text())) return;
    if (['error', 'warning'].includes(message.type())) complaints.push(`${message.text()} ${message.location().url}`);
  });
  page.on('pageerror', (error) => complaints.push(String(error)));
  page.on('request', (request) => requests.push(request.url()));
  await page.goto(server.url + (token ? `#${server.token}` : ''), { waitUntil: 'domcontentloaded' });
  const close = async () => {
    await context.close();
    open--;
    if (own) await used.close();
    else if (open === 0) {
      const last = browser;
      browser = null;
      await last.close();
    }
  };
  return { page, context, complaints, requests, close };
}

function launch(flags) {
  return chromium.launch({ executablePath: executable, args: ['--no-sandbox', '--enable-unsafe-swiftshader', ...flags] });
}
