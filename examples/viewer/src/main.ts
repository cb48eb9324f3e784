import './style.css';
import { byId } from './dom';
import { graphics } from './stage/gpu';
import { showError } from './message';
import { startTheme } from './theme';

// This file is small, so that colours and a graphics context are there while the rest comes.
startTheme();
const query = new URLSearchParams(location.search);
const address = query.get('pkg') ?? '';
// No panel where the address says so, and none without a package.
document.body.classList.toggle('wide', address === '' || ['0', 'none'].includes(query.get('panel') ?? ''));
document.body.classList.toggle('visitor', query.get('panel') === 'none');

const app = import('./app');
app.catch(() => undefined); // `await app` below tells of it
try {
  if (address !== '') graphics(byId<HTMLCanvasElement>('view'));
  (await app).start(query);
} catch (error) {
  byId('status').textContent = '';
  byId('phase').textContent = 'Failed';
  showError(error, address); // no WebGL, an address that is no URL, or a part of the page that did not come
}
