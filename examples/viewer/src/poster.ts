import { byId } from './dom';

const picture = (): HTMLImageElement => byId<HTMLImageElement>('poster');

/** Shows a picture of the object until the object is there. The stage has the posters' grey from then on. */
export function showPoster(url: string): void {
  if (url === '') return;
  picture().src = url;
  picture().hidden = false;
  document.body.classList.add('posed');
}

/** The object is there: the picture fades. */
export function hidePoster(): void {
  picture().classList.add('gone');
}
