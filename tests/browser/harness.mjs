// A small runner: cases one after the other, each with a time limit, a JUnit file as tests/run counts them.
import fs from 'node:fs';
import path from 'node:path';

const cases = [];

let running;

/** Registers a case. `body` gets {skip(reason)}; what it throws is the failure. `timed`: it is held to times, and wants the machine for itself. */
export function test(name, body, {seconds = 60, timed = false} = {}) {
  cases.push({name, body, seconds, timed});
}

/** Whether what runs has the machine for itself: a timed case, or a program that measures. */
export const hasMachine = () => running?.timed ?? true;

class Skipped extends Error {}

const escaped = (text) => String(text).replace(/[<>&"]/g, (c) => `&#${c.charCodeAt(0)};`).replace(/[^\x20-\x7e\n]/g, '?');

/**
 * Runs every case whose name holds one of TEXMESH_BROWSER_ONLY, with commas between (all without it), and that is timed, or is not, as `timed`
 * says (both without it). Gives 1 when one fails.
 */
export async function runAll(suite, timed) {
  const only = (process.env.TEXMESH_BROWSER_ONLY ?? '').split(',');
  const results = [];
  for (const c of cases.filter((x) => only.some((text) => x.name.includes(text)) && x.timed === (timed ?? x.timed))) {
    running = c;
    const start = performance.now();
    let timer;
    const late = new Promise((_, fail) => {
      timer = setTimeout(() => fail(new Error(`no end after ${c.seconds} s`)), c.seconds * 1000);
    });
    const result = {name: c.name, seconds: 0};
    try {
      const skip = (reason) => { throw new Skipped(reason); };
      await Promise.race([c.body({skip}), late]);
      result.status = 'ok';
    } catch (error) {
      result.status = error instanceof Skipped ? 'skipped' : 'FAILED';
      result.message = error instanceof Skipped ? error.message : error.stack ?? String(error);
    }
    clearTimeout(timer);
    result.seconds = (performance.now() - start) / 1000;
    results.push(result);
    console.log(`${result.status.padEnd(8)} ${result.seconds.toFixed(1).padStart(6)} s  ${c.name}${result.message ? `: ${result.message}` : ''}`);
  }
  writeReport(suite, results);
  const failed = results.filter((r) => r.status === 'FAILED').length;
  console.log(`${results.length} cases, ${failed} failed`);
  return failed === 0 && results.length > 0 ? 0 : 1;
}

/** GoogleTest's layout, to the folder that its environment variable names: tests/run reads both alike. */
function writeReport(suite, results) {
  const folder = /^xml:(.*\/)$/.exec(process.env.GTEST_OUTPUT ?? '')?.[1];
  if (!folder) return;
  const count = (status) => results.filter((r) => r.status === status).length;
  const lines = results.map((r) => {
    const inside = r.status === 'FAILED' ? `<failure message="${escaped(r.message)}"/>` :
      r.status === 'skipped' ? `<skipped message="${escaped(r.message)}"/>` : '';
    return `    <testcase name="${escaped(r.name)}" classname="${suite}" time="${r.seconds.toFixed(3)}">${inside}</testcase>`;
  });
  fs.mkdirSync(folder, {recursive: true});
  fs.writeFileSync(path.join(folder, `${suite}.xml`), [
    '<?xml version="1.0" encoding="UTF-8"?>',
    `<testsuites tests="${results.length}" failures="${count('FAILED')}" disabled="0" errors="0" name="${suite}">`,
    `  <testsuite name="${suite}" tests="${results.length}" failures="${count('FAILED')}">`, ...lines, '  </testsuite>',
    '</testsuites>', ''].join('\n'));
}
