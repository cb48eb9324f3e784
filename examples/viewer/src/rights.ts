import type { About } from 'texmesh';

/** Whose the object is, and its licence with the place where that can be read; '' = not known. */
export interface Rights {
  by: string;
  licence: string;
  url: string;
}

/** What the viewer shows of about.json beside the title. */
export function rightsOf(about: About | null): Rights {
  return { by: about?.attribution ?? about?.creator ?? '', licence: about?.licence ?? '',
    url: (about?.licence && about.licenceUrl) || '' };
}
