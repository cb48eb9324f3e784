// Makes the files that a user of gltfpack, WebP and Draco could try for a number of bytes: every ratio of
// simplification x every size of textures, at the highest WebP quality that fits. extract_bench rates them all.
//
//   node make-peers.mjs SOURCE.glb OUTPUT-FOLDER 100,250,500,1000
//
// Textures of normals and of roughness get the base colour's sides, a half or a quarter of them.
// The numbers of bits are lean, so that the other side is no straw man.
import { spawnSync } from 'node:child_process';
import { mkdirSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { NodeIO } from '@gltf-transform/core';
import { ALL_EXTENSIONS, EXTTextureWebP } from '@gltf-transform/extensions';
import { dedup, draco, listTextureSlots, prune, weld } from '@gltf-transform/functions';
import draco3d from 'draco3dgltf';
import sharp from 'sharp';

const [source, folder, budgetText] = process.argv.slice(2);
const budgets = (budgetText ?? '100,250,500,1000').split(',').map((x) => Number(x) * 1000);
const gltfpack = join(dirname(fileURLToPath(import.meta.url)), 'node_modules/gltfpack/cli.js');
const ratios = [1, 0.6, 0.35, 0.2, 0.12, 0.07, 0.04, 0.02, 0.01];
const modes = [['plain', []], ['permissive', ['-sp']]];
const parts = [1, 2, 4];
const sizes = [2048, 1448, 1024, 724, 512, 362, 256, 128];
const qualities = [96, 92, 88, 82, 75, 65, 55, 45, 35, 25, 15, 8, 3];

const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({
  'draco3d.encoder': await draco3d.createEncoderModule(),
  'draco3d.decoder': await draco3d.createDecoderModule(),
});

const coded = new Map();
/** The texture as WebP; key tells textures of one source apart. */
async function webp(key, image, side, quality) {
  const name = `${key} ${side} ${quality}`;
  if (!coded.has(name)) {
    const buffer = await sharp(image)
      .resize(side, side, { fit: 'inside', withoutEnlargement: true, kernel: 'lanczos3' })
      .webp({ quality, effort: 6 })
      .toBuffer();
    coded.set(name, new Uint8Array(buffer));
  }
  return coded.get(name);
}

async function simplified(ratio, mode, flags) {
  const file = join(folder, `simplified-${mode}-${ratio}.tmp.glb`);
  const args = [gltfpack, '-i', source, '-o', file, '-noq', '-kn', '-km', '-si', String(ratio), '-se', '0.1', ...flags];
  if (spawnSync('node', args, { stdio: 'inherit' }).status !== 0) throw new Error('gltfpack failed');
  const document = await io.read(file);
  rmSync(file);
  await document.transform(
    dedup(),
    prune(),
    weld(),
    draco({ method: 'edgebreaker', encodeSpeed: 0, decodeSpeed: 0, quantizePosition: 12, quantizeNormal: 8,
            quantizeTexcoord: 12, quantizeColor: 6, quantizationVolume: 'scene' }));
  return document;
}

mkdirSync(folder, { recursive: true });
const seen = new Set();
for (const [mode, flags] of modes) {
  for (const ratio of ratios) {
    const document = await simplified(ratio, mode, flags);
    document.createExtension(EXTTextureWebP).setRequired(true);
    const textures = document.getRoot().listTextures().map((texture) => ({
      texture,
      image: texture.getImage(),
      colours: listTextureSlots(texture).some((slot) => /baseColor|emissive/.test(slot)),
    }));
    const empty = await sharp({ create: { width: 1, height: 1, channels: 3, background: '#888' } }).webp().toBuffer();
    for (const { texture } of textures) texture.setImage(new Uint8Array(empty)).setMimeType('image/webp');
    const fixed = (await io.writeBinary(document)).length;
    if (seen.has(`${mode} ${fixed}`)) continue; // the simplifier stops where it stopped before
    seen.add(`${mode} ${fixed}`);
    for (const budget of budgets) {
      if (fixed >= budget) continue;
      const shapes = sizes.flatMap((size) => parts.map((part) => [size, part]));
      for (const [size, part] of textures.some((t) => !t.colours) ? shapes : textures.length ? sizes.map((s) => [s, 1]) : [[1, 1]]) {
        const files = async (quality) =>
          Promise.all(textures.map(({ image, colours }, k) => webp(k, image, colours ? size : Math.ceil(size / part), quality)));
        let low = 0, high = qualities.length; // the first quality of the list that fits
        const fits = async (i) => fixed + (await files(qualities[i])).reduce((sum, f) => sum + f.length, 0) <= budget;
        while (low < high) {
          const middle = (low + high) >> 1;
          if (await fits(middle)) high = middle;
          else low = middle + 1;
        }
        if (low === qualities.length) continue;
        const chosen = await files(qualities[low]);
        textures.forEach(({ texture }, k) => texture.setImage(chosen[k]));
        const bytes = await io.writeBinary(document);
        if (bytes.length > budget) continue;
        // Far below the budget at the best quality: a larger texture or a smaller budget has its place.
        if (low === 0 && size !== sizes[0] && bytes.length < 0.7 * budget) continue;
        writeFileSync(join(folder, `${budget / 1000}kB-${mode}-${ratio}-${size}px-${part}-q${qualities[low]}.glb`), bytes);
      }
    }
  }
}
