// Pictures for the mock server: a lit gyroid in a ball, marched in plain JavaScript, with noise that falls with the samples.
import { deflateSync } from "node:zlib";
import jpeg from "jpeg-js";
import { basis } from "../../static/camera.js";

const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k += 1) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

/** @param {Buffer} bytes */
function crc(bytes) {
  let c = 0xffffffff;
  for (const byte of bytes) c = (CRC[(c ^ byte) & 255] ?? 0) ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

/** @param {string} type @param {Buffer} data */
function chunk(type, data) {
  const body = Buffer.concat([Buffer.from(type, "latin1"), data]);
  const out = Buffer.alloc(body.length + 8);
  out.writeUInt32BE(data.length);
  body.copy(out, 4);
  out.writeUInt32BE(crc(body), body.length + 4);
  return out;
}

/** @param {Buffer} rgba @param {number} width @param {number} height */
export function png(rgba, width, height) {
  const rows = Buffer.alloc((width * 4 + 1) * height);
  for (let y = 0; y < height; y += 1) rgba.copy(rows, y * (width * 4 + 1) + 1, y * width * 4, (y + 1) * width * 4);
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 6, 0, 0, 0], 8);
  const sign = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
  return Buffer.concat([sign, chunk("IHDR", head), chunk("IDAT", deflateSync(rows, { level: 3 })), chunk("IEND", Buffer.alloc(0))]);
}

/** @param {Buffer} rgba @param {number} width @param {number} height */
export function jpg(rgba, width, height) {
  return jpeg.encode({ data: rgba, width, height }, 80).data;
}

/**
 * @param {any} scene @param {number} width @param {number} height @param {number} spp @param {number} steps
 * @returns {Buffer} RGBA
 */
export function picture(scene, width, height, spp, steps) {
  const { f, r, v, k } = basis(scene.camera);
  const [px, py, pz] = scene.camera.position;
  const [main = {}] = /** @type {any[]} */ (Object.values(scene.volumes));
  const tint = main.medium?.albedo ?? [0.9, 0.9, 0.9];
  const thick = Math.log10(1 + (main.medium?.sigma_t ?? 40)) * 3;
  const sun = scene.light.sun.irradiance;
  const phase = steps * 0.02;
  const gain = 2 ** scene.display.exposure;
  const out = Buffer.alloc(width * height * 4);
  const noise = 0.5 / Math.sqrt(spp);
  for (let y = 0; y < height; y += 1) {
    for (let x = 0; x < width; x += 1) {
      const a = ((2 * (x + 0.5)) / width - 1) * k * (width / height);
      const b = (1 - (2 * (y + 0.5)) / height) * k;
      let dx = f[0] + a * r[0] + b * v[0], dy = f[1] + a * r[1] + b * v[1], dz = f[2] + a * r[2] + b * v[2];
      const size = Math.hypot(dx, dy, dz);
      dx /= size; dy /= size; dz /= size;
      const light = [0.012 + 0.02 * Math.max(0, dy), 0.016 + 0.03 * Math.max(0, dy), 0.03 + 0.06 * Math.max(0, dy)];
      const half = px * dx + py * dy + pz * dz;
      const depth = half * half - (px * px + py * py + pz * pz - 0.3);
      if (depth > 0) {
        const from = Math.max(0, -half - Math.sqrt(depth));
        const to = -half + Math.sqrt(depth);
        let through = 1;
        const n = 26;
        const h = Math.max(0, to - from) / n;
        for (let i = 0; i < n && through > 0.03; i += 1) {
          const t = from + (i + Math.random()) * h;
          const X = (px + t * dx) * 11, Y = (py + t * dy) * 11, Z = (pz + t * dz) * 11;
          const wave = Math.sin(X + phase) * Math.cos(Y) + Math.sin(Y) * Math.cos(Z + phase) + Math.sin(Z) * Math.cos(X);
          const ball = 1 - (X * X + Y * Y + Z * Z) / (121 * 0.3);
          const density = Math.max(0, 0.5 - Math.abs(wave)) * Math.sqrt(Math.max(0, ball)) * thick;
          if (density <= 0) continue;
          const step = 1 - Math.exp(-density * h * 6);
          const rim = Math.exp(-1.6 * ball * ball) * (0.25 + 0.75 * Math.max(0, 0.5 + 0.35 * X / 5 + 0.4 * Y / 5));
          for (let c = 0; c < 3; c += 1) light[c] = (light[c] ?? 0) + through * step * tint[c] ** (2 + 4 * (1 - rim)) * (0.03 + 0.16 * rim * sun[c]);
          through *= 1 - step;
        }
      }
      const at = 4 * (y * width + x);
      const grain = 1 + noise * (Math.random() - 0.5) * 2;
      for (let c = 0; c < 3; c += 1) out[at + c] = 255 * Math.min(1, (1 - Math.exp(-(light[c] ?? 0) * grain * gain * 1.6)) ** (1 / 2.2));
      out[at + 3] = 255;
    }
  }
  return out;
}
