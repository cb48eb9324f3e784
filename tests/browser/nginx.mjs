// Debian's nginx with examples/serve/nginx.conf, over HTTP/1.1 or, with a certificate made here, HTTP/2.
import {execFileSync, spawn, spawnSync} from 'node:child_process';
import net from 'node:net';
import {env, fs, labRoots, packages, path} from './browser.mjs';

const has = (tool) => spawnSync('sh', ['-c', `command -v ${tool}`]).status === 0;

async function freePort() {
  const server = net.createServer();
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const {port} = server.address();
  await new Promise((done) => server.close(done));
  return port;
}

async function listening(port) {
  for (let i = 0; i < 100; i++) {
    const open = await new Promise((done) => {
      const s = net.connect(port, '127.0.0.1', () => { s.destroy(); done(true); });
      s.on('error', () => done(false));
    });
    if (open) return;
    await new Promise((done) => setTimeout(done, 50));
  }
  throw new Error(`nothing listens on port ${port}`);
}

/** Why nginx cannot be tested here; '' when it can. */
export function nginxMissing(http2) {
  if (!has('nginx')) return 'nginx is not installed';
  return http2 && !has('openssl') ? 'openssl is not installed' : '';
}

/** `roots`: folders by the prefixes beneath which they stand, as for `serve`. */
export async function startNginx({http2 = false, roots = labRoots} = {}) {
  const folder = fs.mkdtempSync(path.join(env.work, 'nginx-'));
  const site = path.join(folder, 'site');
  fs.mkdirSync(site);
  for (const [prefix, target] of Object.entries(roots)) {
    if (prefix === '/') for (const f of fs.readdirSync(target)) fs.symlinkSync(path.join(target, f), path.join(site, f));
    else fs.symlinkSync(prefix === '/packages/' ? packages : target, path.join(site, prefix.slice(1, -1)));
  }
  const port = await freePort();
  let listen = `listen 127.0.0.1:${port}`;
  if (http2) {
    execFileSync('openssl', ['req', '-x509', '-newkey', 'rsa:2048', '-nodes', '-days', '2', '-subj', '/CN=localhost', '-addext', 'subjectAltName=IP:127.0.0.1',
      '-keyout', path.join(folder, 'key.pem'), '-out', path.join(folder, 'cert.pem')], {stdio: 'ignore'});
    listen += ` ssl http2;\n    ssl_certificate ${folder}/cert.pem;\n    ssl_certificate_key ${folder}/key.pem`;
  }
  const example = path.join(env.source, 'examples/serve/nginx.conf');
  const server = fs.readFileSync(example, 'utf8').replace('listen 8080', listen).replace('/srv/texmesh', site);
  const temporary = ['client_body', 'proxy', 'fastcgi', 'uwsgi', 'scgi'].map((t) => `${t}_temp_path ${folder}/${t};`).join(' ');
  fs.writeFileSync(path.join(folder, 'nginx.conf'), `
${process.getuid() === 0 ? 'user root; ' : ''}worker_processes 1; daemon off; pid ${folder}/pid; error_log ${folder}/error.log;
events {}
http {
  access_log ${folder}/access.log; ${temporary}
  types { text/html html; text/css css; text/javascript js mjs; application/wasm wasm; image/svg+xml svg; image/jpeg jpg; }
  ${server}
}`);
  const child = spawn('nginx', ['-p', folder, '-c', path.join(folder, 'nginx.conf')], {stdio: 'ignore'});
  await listening(port);
  return {
    url: `${http2 ? 'https' : 'http'}://127.0.0.1:${port}`, port,
    log: () => fs.readFileSync(path.join(folder, 'access.log'), 'utf8'),
    close: () => { child.kill('SIGTERM'); },
  };
}
