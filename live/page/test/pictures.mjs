// Pictures for the mock server, drawn and encoded here: no file, no package. Grey wall, ring markers, the overlay's colours.
import { deflateSync } from 'node:zlib';

const table = Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c >>> 0;
});
function crc32(bytes) {
  let c = 0xffffffff;
  for (const byte of bytes) c = table[(c ^ byte) & 255] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}
function chunk(kind, data) {
  const body = Buffer.concat([Buffer.from(kind, 'ascii'), data]);
  const made = Buffer.alloc(body.length + 8);
  made.writeUInt32BE(data.length, 0);
  body.copy(made, 4);
  made.writeUInt32BE(crc32(body), body.length + 4);
  return made;
}

/** RGB bytes as a PNG. */
export function png(width, height, rgb) {
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 2, 0, 0, 0], 8);
  const rows = Buffer.alloc(height * (3 * width + 1));
  for (let y = 0; y < height; y++) rgb.copy(rows, y * (3 * width + 1) + 1, 3 * width * y, 3 * width * (y + 1));
  const signature = Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]);
  return Buffer.concat([signature, chunk('IHDR', head), chunk('IDAT', deflateSync(rows, { level: 1 })), chunk('IEND', Buffer.alloc(0))]);
}

function random(seed) {
  let s = seed >>> 0;
  return () => {
    s = (Math.imul(s, 1664525) + 1013904223) >>> 0;
    return s / 4294967296;
  };
}

const bits = [1, 1, 0, 1, 0, 0, 1, 0, 1, 0];

/** One picture: a curved wall with markers; `shift` moves the markers, `seed` the noise. */
export function wall(width, height, shift, seed) {
  const rgb = Buffer.alloc(3 * width * height);
  const noise = random(seed);
  const markers = [];
  const place = random(7);
  for (let i = 0; i < 9; i++) {
    markers.push({
      x: width * (0.14 + 0.36 * (i % 3)) + shift + 18 * (place() - 0.5),
      y: height * (0.18 + 0.31 * Math.floor(i / 3)) + 18 * (place() - 0.5),
      r: 6.5 + 1.5 * place(),
      state: i === 4 ? 'doubtful' : i === 7 ? 'uncoded' : 'coded',
      turn: Math.floor(10 * place()),
    });
  }
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const u = (x - 0.52 * width) / width;
      let grey = 150 - 190 * u * u - 40 * (y / height - 0.4) ** 2 + 14 * (noise() - 0.5);
      let hole = ((x - 0.5 * width - shift) / (0.30 * width)) ** 2 + ((y - 0.52 * height) / (0.2 * height)) ** 2;
      if (hole < 1) grey = 9 + 8 * noise();
      let colour = null;
      for (const marker of markers) {
        const dx = (x - marker.x) * 1.12;
        const dy = y - marker.y;
        const d = Math.hypot(dx, dy) / marker.r;
        if (d > 4.3) continue;
        if (d < 3.6) {
          grey = 214 + 10 * noise();
          if (d < 3.2) grey = 26 + 8 * noise();
          if (d < 1) grey = 226 + 10 * noise();
          const sector = (Math.floor((Math.atan2(dy, dx) / Math.PI + 1) * 5) + marker.turn) % 10;
          if (marker.state !== 'uncoded' && d > 1.8 && d < 2.6 && bits[sector]) grey = 222 + 10 * noise();
        }
        if (Math.abs(d - 4.0) < 1.3 / marker.r) colour = { coded: [0, 230, 0], uncoded: [0, 229, 229], doubtful: [255, 224, 0] }[marker.state];
        if (Math.min(Math.abs(dx), Math.abs(dy)) < 0.6 && d < 0.9) colour = [0, 160, 0];
      }
      const glare = ((x - 0.8 * width) / 26) ** 2 + ((y - 0.2 * height) / 8) ** 2 < 1;
      if (glare) colour = [255, 20, 20];
      const at = 3 * (y * width + x);
      const value = Math.max(0, Math.min(255, grey));
      rgb[at] = colour ? colour[0] : value;
      rgb[at + 1] = colour ? colour[1] : value;
      rgb[at + 2] = colour ? colour[2] : value;
    }
  }
  return png(width, height, rgb);
}

const cache = new Map();
/** A few pictures for each side, made once. */
export function pictures(side) {
  if (!cache.has(side)) cache.set(side, [1, 2, 3].map((seed) => wall(612, 512, side === 'left' ? 14 : -14, seed + (side === 'left' ? 0 : 10))));
  return cache.get(side);
}
