// The object in the room of whoever looks: Apple's Quick Look, Android's Scene Viewer, WebXR.

import { make } from './layer';

/** Files that programs for rooms open; absolute addresses. */
export interface ArFiles {
  /** A GLB, for Scene Viewer and WebXR. */
  glb?: string;
  /** A USDZ, for Quick Look. */
  usdz?: string;
  title?: string;
}
/** What can show the object here. */
export type ArWay = 'webxr' | 'scene-viewer' | 'quick-look';
interface Xr {
  isSessionSupported(mode: string): Promise<boolean>;
}
/** What a browser says of itself. */
export interface ArBrowser {
  userAgent: string;
  maxTouchPoints?: number;
  xr?: Xr;
  /** Whether links may have rel=ar. */
  hasRelAr?: boolean;
}

const thisBrowser = (): ArBrowser => {
  const { userAgent, maxTouchPoints } = navigator, { relList } = document.createElement('a');
  return { userAgent, maxTouchPoints, xr: (navigator as { xr?: Xr }).xr,
    hasRelAr: relList?.supports?.('ar') ?? false };
};

/** The best way that this browser has and that the files suit; undefined: none, and no button is right. */
export async function arWay(files: ArFiles, browser = thisBrowser()): Promise<ArWay | undefined> {
  const { userAgent, maxTouchPoints = 0, xr, hasRelAr } = browser;
  if (files.glb && await xr?.isSessionSupported('immersive-ar').catch(() => false)) return 'webxr';
  if (files.glb && /android/i.test(userAgent)) return 'scene-viewer';
  const apple = /iPhone|iPad|iPod/.test(userAgent) || (/Macintosh/.test(userAgent) && maxTouchPoints > 1);
  return files.usdz && (hasRelAr || apple) ? 'quick-look' : undefined;
}

/** The address that opens a GLB in Android's Scene Viewer; `back` where there is none. */
export function sceneViewerAddress({ glb = '', title = '' }: ArFiles, back: string): string {
  const asked = `file=${encodeURIComponent(glb)}&mode=ar_preferred&title=${encodeURIComponent(title)}`;
  return `intent://arvr.google.com/scene-viewer/1.2?${asked}#Intent;scheme=https;` +
    'package=com.google.android.googlequicksearchbox;action=android.intent.action.VIEW;' +
    `S.browser_fallback_url=${encodeURIComponent(back)};end;`;
}

const icon = `data:image/svg+xml,${encodeURIComponent('<svg xmlns="http://www.w3.org/2000/svg" ' +
  'viewBox="0 0 32 32" fill="none" stroke="#0b57a4" stroke-width="2" stroke-linejoin="round">' +
  '<path d="M16 8l8 4.5v8L16 25l-8-4.5v-8zM8 12.5l8 4.5 8-4.5M16 17v8' +
  'M3 9V3h6M29 9V3h-6M3 23v6h6M29 23v6h-6"/></svg>')}`;

/** A link or button that shows the object so; `words` say what it does. */
export function arButton(way: ArWay, files: ArFiles, words: string): HTMLElement {
  // Quick Look opens in the room where the link has rel=ar and holds one picture and nothing else.
  const picture = make('img', { src: icon, alt: words, width: '32', height: '32' });
  const looks = { class: 'ar', part: 'ar-button' };
  if (way === 'webxr') {
    const button = make('button', { ...looks, title: words }, '', () =>
      void import('./webxr').then(({ showInRoom }) => showInRoom(files.glb!)).catch((error: unknown) =>
        console.error('<texmesh-viewer ar>:', error)));
    button.append(picture);
    return button;
  }
  const link = make('a', { ...looks, href: way === 'quick-look' ? files.usdz!
    : sceneViewerAddress(files, location.href), ...(way === 'quick-look' ? { rel: 'ar' } : {}) });
  link.append(picture);
  return link;
}
