#!/usr/bin/env node
// texmesh-verify PACKAGE...: which rule of format/SPEC.md each package breaks first, if any. A package is a container or the folder of
// a tree. Exit code 1: one of them breaks a rule or cannot be read.
import { readFileSync, readdirSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { verifyPackage } from './dist/verify.js';

function read(path) {
  if (!statSync(path).isDirectory()) return readFileSync(path);
  const names = readdirSync(path, { recursive: true }).filter((name) => statSync(join(path, name)).isFile());
  return new Map(names.map((name) => [name.replaceAll('\\', '/'), readFileSync(join(path, name))]));
}
const packages = process.argv.slice(2);
if (packages.length === 0 || packages[0].startsWith('-')) {
  console.error('texmesh-verify PACKAGE...');
  process.exit(2);
}
for (const path of packages)
  try {
    await verifyPackage(read(path));
    console.log(`${path}: no rule broken`);
  } catch (error) {
    console.log(`${path}: refused: ${error.message}`);
    process.exitCode = 1;
  }
