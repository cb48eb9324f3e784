// plain_glb.mjs IN.glb OUT.glb: what people publish today: glTF-Transform's Draco and WebP with their defaults.
import {NodeIO} from '@gltf-transform/core';
import {ALL_EXTENSIONS} from '@gltf-transform/extensions';
import {dedup, draco, prune, textureCompress} from '@gltf-transform/functions';
import draco3d from 'draco3dgltf';
import sharp from 'sharp';

const [source, target] = process.argv.slice(2);
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({
  'draco3d.encoder': await draco3d.createEncoderModule(), 'draco3d.decoder': await draco3d.createDecoderModule(),
});
const document = await io.read(source);
await document.transform(dedup(), prune(), textureCompress({encoder: sharp, targetFormat: 'webp'}), draco());
await io.write(target, document);
