// Chapter 4 as printed, for planDelivery(), and thesis.bin. Apart from the library, which loads its part of
// this where the policy is thesis.

export * from './decide/thesis_list';
export * from './format/thesis_tables';
export * from './http/read_thesis';
