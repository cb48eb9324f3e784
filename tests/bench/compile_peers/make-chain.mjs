// Six levels of detail by gltfpack, WebP and Draco in their leanest form, one process with the libraries: each has half
// the triangles of the one before, its textures as WebP (sharp), its mesh as Draco (glTF-Transform). type-chain.mjs does
// the same by the commands that a user types.
//
//   node make-chain.mjs SOURCE.glb OUTPUT-FOLDER full|halved
//
// full: every level has whole textures. halved: sides are halved from level to level.
import { spawnSync } from 'node:child_process';
import { mkdirSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { NodeIO } from '@gltf-transform/core';
import { ALL_EXTENSIONS, EXTTextureWebP } from '@gltf-transform/extensions';
import { dedup, draco, prune, weld } from '@gltf-transform/functions';
import draco3d from 'draco3dgltf';
import sharp from 'sharp';

const [source, folder, textures] = process.argv.slice(2);
if (textures !== 'full' && textures !== 'halved') throw new Error('full or halved?');
const gltfpack = join(dirname(fileURLToPath(import.meta.url)), 'node_modules/gltfpack/cli.js');
const LEVELS = 6;
const QUALITY = 80; // WebP's usual one
sharp.concurrency(1);

const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({
  'draco3d.encoder': await draco3d.createEncoderModule(),
  'draco3d.decoder': await draco3d.createDecoderModule(),
});

async function simplified(level) {
  const file = join(folder, `level-${level}.tmp.glb`);
  const args = [gltfpack, '-i', source, '-o', file, '-noq', '-kn', '-km', '-si', String(0.5 ** level), '-se', '0.1'];
  if (spawnSync('node', args, { stdio: 'inherit' }).status !== 0) throw new Error('gltfpack failed');
  const document = await io.read(file);
  rmSync(file);
  return document;
}

async function codeTextures(document, level) {
  document.createExtension(EXTTextureWebP).setRequired(true);
  for (const texture of document.getRoot().listTextures()) {
    const image = sharp(texture.getImage());
    const { width, height } = await image.metadata();
    const times = textures === 'halved' ? 0.5 ** level : 1;
    const bytes = await image
      .resize(Math.max(1, Math.round(width * times)), Math.max(1, Math.round(height * times)))
      .webp({ quality: QUALITY })
      .toBuffer();
    texture.setImage(new Uint8Array(bytes)).setMimeType('image/webp');
  }
}

mkdirSync(folder, { recursive: true });
for (let level = 0; level < LEVELS; ++level) {
  const document = await simplified(level);
  await codeTextures(document, level);
  await document.transform(dedup(), prune(), weld(), draco({ method: 'edgebreaker', encodeSpeed: 3, decodeSpeed: 3 }));
  writeFileSync(join(folder, `level-${level}.glb`), await io.writeBinary(document));
}
