import './style.css';
import { byId } from './dom';
import { graphics } from './stage/gpu';
import { showError } from './message';
import { startTheme } from './theme';

// Small, so that the page has its colours, and a graphics context, while the rest is on its way.
startTheme();
const query = new URLSearchParams(location.search);
const address = query.get('pkg') ?? '';
// Without a panel where nobody wants it, and where there is nothing to say about no package.
document.body.classList.toggle('wide', address === '' || query.get('panel') === '0');

const app = import('./app');
app.catch(() => undefined); // heard below
try {
  if (address !== '') graphics(byId<HTMLCanvasElement>('view'));
  (await app).start(query);
} catch (error) {
  byId('status').textContent = '';
  byId('phase').textContent = 'Failed';
  showError(error, address); // no WebGL, an address that is none, or a part of the page that did not come
}
