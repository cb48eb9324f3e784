// How long this machine has kept the browser waiting for a processor: a deadline that is missed by no more says nothing of the client.
import fs from 'node:fs';
import {hasMachine} from './harness.mjs';

/** Processes by their parents' ids. */
function children() {
  const of = new Map();
  for (const pid of fs.readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
    try {
      const parent = fs.readFileSync(`/proc/${pid}/stat`, 'utf8').replace(/^.*\) /, '').split(' ')[1];
      of.set(parent, [...(of.get(parent) ?? []), pid]);
    } catch { /* it has ended */ }
  }
  return of;
}

/** Seconds that each thread of this process and of all below it has stood in the queue for a processor since it began. */
function queued() {
  const [of, seconds] = [children(), new Map()];
  const add = (pid) => {
    try {
      for (const tid of fs.readdirSync(`/proc/${pid}/task`)) seconds.set(tid, Number(fs.readFileSync(`/proc/${pid}/task/${tid}/schedstat`, 'utf8').split(' ')[1]) / 1e9);
    } catch { /* it has ended, or the kernel does not count */ }
    (of.get(pid) ?? []).forEach(add);
  };
  add(`${process.pid}`);
  return seconds;
}

/**
 * Starts a clock; the clock gives the seconds that the most starved thread has waited for a processor since. A machine with nothing else
 * to do says hundredths of a second, so a late client is late there.
 */
export function starvation() {
  if (!hasMachine()) throw new Error('a case that is held to times must say so: {timed: true}');
  const before = queued();
  return () => Math.max(0, ...[...queued()].map(([tid, s]) => s - (before.get(tid) ?? 0)));
}
