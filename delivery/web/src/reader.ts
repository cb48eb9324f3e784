// The package reader and the decisions about what to load, without three.js: works in Node.js and browsers.

export * from './decisions';
export * from './decide/harmonic_time';
export * from './decide/delivery_plan';
export * from './decide/proxy_steps';
export * from './decide/gpu_size';
export { planesWithin, scaleWithin } from './decide/gpu_memory';
