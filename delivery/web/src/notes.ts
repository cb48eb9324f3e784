// Notes at points of the object, and measuring. Apart from the library: nothing of an ordinary load needs it.

export * from './format/annotations';
export * from './notes/editor';
export * from './notes/layer';
export * from './notes/measure';
export * from './notes/measuring';
export * from './notes/pick';
export * from './notes/read';
export * from './notes/texts';
export * from './notes/words';
