// thesis.bin and what a client decides by it: a just-noticeable difference of its own, and the size model. No other entry needs it.

export * from './format/thesis/thesis_tables';
export * from './decide/thesis/jnd_choice';
export * from './decide/thesis/size_model';
export { readThesis } from './http/read_thesis';
