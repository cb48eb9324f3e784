// Chapter 4 as printed: for planDelivery(), and its Theorem 4.1. Apart from the library, which loads this where the policy is thesis.

export { asPrinted, gammaForBytes, thesisTextures } from './decide/thesis/thesis_list';
export * from './decide/thesis/htc_theorem';
export type { ThesisTextures } from './decide/thesis/thesis_list';
