// Serves the contract of `crosstie live` with scripted states: node test/mock_server.mjs [state] [port]
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { fileURLToPath } from 'node:url';
import { pictures } from './pictures.mjs';
import { base, scene, states } from './states.mjs';

const page = new URL('../dist/index.html', import.meta.url);

export class MockServer {
  token = 'test-token-0123456789';
  posts = [];
  paths = [];
  refuse = null;  // [status, message]
  silentCameras = false;
  sceneVersions = [];
  state = base();
  #server = null;
  #events = new Set();
  #cameras = new Set();
  #timer = null;

  async start(port = 0) {
    this.#server = createServer((request, response) => this.#serve(request, response));
    await new Promise((resolve) => this.#server.listen(port, '127.0.0.1', resolve));
    this.port = this.#server.address().port;
    let beat = 0;
    this.#timer = setInterval(() => {
      for (const camera of this.#cameras) this.#picture(camera);
      if (++beat % 25 === 0) for (const one of this.#events) one.write(': alive\n\n');
    }, 100);
    return this;
  }

  get url() {
    return `http://127.0.0.1:${this.port}/`;
  }

  /** As a program that ends: all connections break. */
  async stop() {
    clearInterval(this.#timer);
    this.#events.clear();
    this.#cameras.clear();
    this.#server.closeAllConnections();
    await new Promise((resolve) => this.#server.close(resolve));
  }

  show(state) {
    this.state = { ...state, sequence: this.state.sequence + 1 };
    for (const one of this.#events) this.#tell(one);
  }

  /** Ends the streams of the cameras only. */
  dropCameras() {
    for (const { response } of this.#cameras) response.socket?.destroy();
    this.#cameras.clear();
  }

  get cameraClients() {
    return this.#cameras.size;
  }

  get eventClients() {
    return this.#events.size;
  }

  #tell(response) {
    response.write(`event: state\ndata: ${JSON.stringify(this.state)}\n\n`);
  }

  #picture(camera) {
    if (this.silentCameras || camera.response.writableNeedDrain) return;
    const list = pictures(camera.side);
    const picture = list[camera.count++ % list.length];
    camera.response.write(`--frame\r\nContent-Type: image/png\r\nContent-Length: ${picture.length}\r\n\r\n`);
    camera.response.write(picture);
    camera.response.write('\r\n');
  }

  #serve(request, response) {
    const path = new URL(request.url, this.url).pathname;
    this.paths.push(`${request.method} ${path}`);
    if (path === '/command') return this.#command(request, response);
    if (request.method !== 'GET') return this.#end(response, 405);
    if (path === '/') return this.#end(response, 200, readFileSync(page), 'text/html; charset=utf-8');
    if (path === '/state') return this.#end(response, 200, JSON.stringify(this.state), 'application/json');
    if (path === '/events') {
      response.writeHead(200, { 'Content-Type': 'text/event-stream', 'Cache-Control': 'no-store' });
      this.#tell(response);
      this.#events.add(response);
      request.on('close', () => this.#events.delete(response));
      return undefined;
    }
    const side = path.match(/^\/camera\/(left|right)$/)?.[1];
    if (side) {
      const running = this.state.cameras.find((one) => one.side === side)?.running;
      if (!running) return this.#end(response, 503);
      response.writeHead(200, { 'Content-Type': 'multipart/x-mixed-replace; boundary=frame', 'Cache-Control': 'no-store' });
      const camera = { side, response, count: 0 };
      this.#cameras.add(camera);
      request.on('close', () => this.#cameras.delete(camera));
      this.#picture(camera);
      return undefined;
    }
    if (path === '/scene') {
      const tag = `"${this.state.scene_version}"`;
      this.sceneVersions.push(this.state.scene_version);
      if (request.headers['if-none-match'] === tag) return this.#end(response, 304);
      response.setHeader('ETag', tag);
      return this.#end(response, 200, JSON.stringify(scene(this.state.scene_version)), 'application/json');
    }
    if (path.startsWith('/results/')) return this.#end(response, 200, '<!doctype html><title>report</title>', 'text/html');
    return this.#end(response, 404);
  }

  #command(request, response) {
    let body = '';
    request.on('data', (part) => (body += part));
    request.on('end', () => {
      if (request.headers['x-crosstie-token'] !== this.token) return this.#end(response, 401, JSON.stringify({ error: 'wrong token' }), 'application/json');
      this.posts.push(JSON.parse(body));
      if (this.refuse) return this.#end(response, this.refuse[0], JSON.stringify({ error: this.refuse[1] }), 'application/json');
      return this.#end(response, 202, '{"accepted": true}', 'application/json');
    });
  }

  #end(response, status, body = '', type = 'text/plain') {
    response.writeHead(status, { 'Content-Type': type, 'Cache-Control': 'no-cache', 'X-Content-Type-Options': 'nosniff' });
    response.end(body);
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const server = await new MockServer().start(Number(process.argv[3] ?? 8137));
  server.show(states[process.argv[2]] ?? states.scan);
  console.log(`${server.url}#${server.token}`);
}
