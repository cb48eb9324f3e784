// Validates every mesh/sNN.glb of packages (.texmesh files or unpacked folders), and GLBs, with the Khronos glTF validator.
//
//   node validate-packages.mjs PACKAGE|GLB... [--strict]
//
// Exit code 0: no error (with --strict: no warning either), 1: findings, 2: usage or a package that cannot be read.
import { existsSync, readFileSync, readdirSync, statSync } from 'node:fs';
import { join } from 'node:path';
import validator from 'gltf-validator';

const kSeverity = ['error', 'warning', 'information', 'hint'];

const kWanted = /^(mesh\/.*\.glb|preview\/.*\.jpg)$/;

/** [path, bytes] of the meshes and previews of an unpacked package. */
function entriesOfFolder(folder) {
  return ['mesh', 'preview']
    .filter((room) => existsSync(join(folder, room)))
    .flatMap((room) => readdirSync(join(folder, room)).sort().map((name) => `${room}/${name}`))
    .filter((path) => kWanted.test(path))
    .map((path) => [path, readFileSync(join(folder, path))]);
}

/** [path, bytes] of the meshes and previews of a container: a ZIP whose entries are stored. */
function entriesOfFile(file) {
  const zip = readFileSync(file);
  let end = zip.length - 22;
  while (end >= 0 && zip.readUInt32LE(end) !== 0x06054b50) --end;
  if (end < 0) throw new Error('no end of central directory');
  const count = zip.readUInt16LE(end + 10);
  let at = zip.readUInt32LE(end + 16);
  if (count === 0xffff || at === 0xffffffff) throw new Error('ZIP64 is not read by this script, unpack the package');
  const entries = [];
  for (let i = 0; i < count; ++i) {
    if (zip.readUInt32LE(at) !== 0x02014b50) throw new Error(`byte ${at}: no central directory header`);
    if (zip.readUInt16LE(at + 10) !== 0) throw new Error(`byte ${at}: the entry is not stored`);
    const bytes = zip.readUInt32LE(at + 20);
    const [nameBytes, extraBytes, commentBytes] = [28, 30, 32].map((k) => zip.readUInt16LE(at + k));
    const header = zip.readUInt32LE(at + 42);
    const name = zip.toString('utf8', at + 46, at + 46 + nameBytes);
    const data = header + 30 + zip.readUInt16LE(header + 26) + zip.readUInt16LE(header + 28);
    if (kWanted.test(name)) entries.push([name, zip.subarray(data, data + bytes)]);
    at += 46 + nameBytes + extraBytes + commentBytes;
  }
  return entries;
}

async function validate(name, bytes, previews) {
  const report = await validator.validateBytes(new Uint8Array(bytes), {
    uri: name,
    format: 'glb',
    externalResourceFunction: (uri) =>
      previews.has(uri) ? Promise.resolve(new Uint8Array(previews.get(uri))) : Promise.reject(new Error('no such preview')),
    maxIssues: 0,
    writeTimestamp: false,
  });
  for (const message of report.issues.messages) {
    if (message.severity > 1) continue;
    console.log(`${name}: ${message.pointer ?? ''}: ${kSeverity[message.severity]} ${message.code}: ${message.message}`);
  }
  return report.issues;
}

const args = process.argv.slice(2);
const strict = args.includes('--strict');
const packages = args.filter((a) => a !== '--strict');
if (packages.length === 0) {
  console.error('usage: node validate-packages.mjs PACKAGE|GLB... [--strict]');
  process.exit(2);
}
let [meshes, errors, warnings] = [0, 0, 0];
for (const path of packages) {
  let entries;
  try {
    if (path.endsWith('.glb')) entries = [['mesh/file.glb', readFileSync(path)]];
    else entries = statSync(path).isDirectory() ? entriesOfFolder(path) : entriesOfFile(path);
  } catch (error) {
    console.error(`${path}: ${error.message}`);
    process.exit(2);
  }
  const glbs = entries.filter(([name]) => name.endsWith('.glb'));
  if (glbs.length === 0) {
    console.error(`${path}: no mesh/*.glb`);
    process.exit(2);
  }
  // A finer scale's file names the previews beside its folder.
  const previews = new Map(entries.filter(([name]) => name.endsWith('.jpg')).map(([name, bytes]) => [`../${name}`, bytes]));
  for (const [name, bytes] of glbs) {
    const issues = await validate(`${path}: ${name}`, bytes, previews);
    ++meshes;
    errors += issues.numErrors;
    warnings += issues.numWarnings;
  }
}
console.log(`${packages.length} packages, ${meshes} meshes: ${errors} errors, ${warnings} warnings`);
process.exit(errors > 0 || (strict && warnings > 0) ? 1 : 0);
