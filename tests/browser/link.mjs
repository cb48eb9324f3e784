// A link in a process of its own: passes TCP connections on to a server on loopback with a bandwidth that all of them share, a
// round trip, changes of the bandwidth, and an end where a test wants one. No packets are lost and TCP's slow start is not played:
// what is measured with it is the client.
//   import {startLink} from './link.mjs';  const link = await startLink({target: port, bytesPerSecond, rttMs, seed, changes});
import {fork} from 'node:child_process';
import net from 'node:net';
import {fileURLToPath} from 'node:url';

const kPacketBytes = 1448;
const kTickMs = 2;
const kUnlimited = 1e12;

/** Mulberry32: equal seeds, equal links. */
export function randomOf(seed) {
  let a = seed >>> 0;
  return () => {
    a = (a + 0x6d2b79f5) >>> 0;
    let t = a;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** The rate at a time: the mean, times 1 - changes ... 1 + changes, new every 0.2 to 1 s. */
export function rateSteps({bytesPerSecond, changes = 0, seed = 1, seconds = 600}) {
  const random = randomOf(seed);
  const steps = [];
  for (let at = 0; at < seconds;) {
    steps.push({at, rate: bytesPerSecond * (1 + changes * (2 * random() - 1))});
    at += changes ? 0.2 + 0.8 * random() : seconds;
  }
  return steps;
}

class Link {
  constructor(options) {
    this.options = {rttMs: 0, changes: 0, seed: 1, bytesPerSecond: kUnlimited, ...options};
    this.restart();
    this.connections = [];
    this.next = 0;
    this.sent = 0;
    this.server = net.createServer({noDelay: true}, (client) => this.accept(client));
  }
  restart() {
    this.start = performance.now();
    this.credit = 0;
    this.last = this.start;
    this.steps = rateSteps(this.options);
  }
  rate(now) {
    const t = (now - this.start) / 1000;
    let rate = this.steps[0].rate;
    for (const s of this.steps) if (s.at <= t) rate = s.rate;
    return rate;
  }
  accept(client) {
    const half = this.options.rttMs / 2;
    const server = net.connect({host: '127.0.0.1', port: this.options.target, noDelay: true});
    const connection = {client, server, queue: [], queued: 0, ended: false, opened: performance.now()};
    this.connections.push(connection);
    // The handshake's round trip cannot be played on accept; so the first bytes come that much later.
    client.on('data', (data) => {
      const wait = Math.max(half, connection.opened + this.options.rttMs + half - performance.now());
      setTimeout(() => server.writable && server.write(data), wait);
    });
    server.on('data', (data) => {
      for (let at = 0; at < data.length; at += kPacketBytes) connection.queue.push(data.subarray(at, at + kPacketBytes));
      connection.queued += data.length;
      if (connection.queued > 1 << 18) server.pause();
    });
    const drop = () => {
      client.destroy();
      server.destroy();
      this.connections = this.connections.filter((c) => c !== connection);
    };
    server.on('end', () => { connection.ended = true; });
    server.on('error', drop);
    client.on('error', drop);
    client.on('close', drop);
    if (!this.timer) this.timer = setInterval(() => this.tick(), kTickMs);
  }
  /** Gives out what the link carries since the last tick, packet by packet in turn. */
  tick() {
    const now = performance.now();
    const rate = this.rate(now);
    this.credit += (rate * (now - this.last)) / 1000;
    this.last = now;
    let idle = 0;
    while (this.credit > 0 && this.connections.length && idle < this.connections.length) {
      const c = this.connections[this.next++ % this.connections.length];
      const packet = c.queue.shift();
      if (!packet) {
        idle++;
        if (c.ended) { c.ended = false; setTimeout(() => c.client.end(), this.options.rttMs / 2); }
        continue;
      }
      idle = 0;
      this.credit -= packet.length;
      this.sent += packet.length;
      c.queued -= packet.length;
      if (c.queued < 1 << 17) c.server.resume();
      setTimeout(() => c.client.writable && c.client.write(packet), this.options.rttMs / 2);
    }
    // A link that had nothing to carry does not make up for it later.
    if (idle >= this.connections.length) this.credit = Math.min(this.credit, 0);
  }
  set(options) {
    Object.assign(this.options, options);
    this.restart();
  }
  die() {
    this.server.close();
    for (const c of [...this.connections]) { c.client.destroy(); c.server.destroy(); }
  }
}

if (process.send) {
  let link;
  process.on('message', (m) => {
    if (m.start) {
      link = new Link(m.start);
      link.server.listen(0, '127.0.0.1', () => process.send({port: link.server.address().port}));
    }
    if (m.set) { link.set(m.set); process.send({set: true}); }
    if (m.ask) process.send({sent: link.sent});
    if (m.die) { link.die(); process.send({dead: true}); }
  });
  process.on('disconnect', () => process.exit(0));
}

/** Starts a link; `set` changes it and starts its clock anew, `sent` counts bytes, `die` breaks it. */
export async function startLink(options) {
  const child = fork(fileURLToPath(import.meta.url));
  const ask = (message) => new Promise((done) => { child.once('message', done); child.send(message); });
  const {port} = await ask({start: options});
  return {
    port, url: `http://127.0.0.1:${port}`,
    set: (more) => ask({set: more}),
    sent: async () => (await ask({ask: true})).sent,
    die: () => ask({die: true}),
    close: () => { child.disconnect(); },
  };
}
