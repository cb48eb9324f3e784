// Chapter 4 as printed, for planDelivery(). Apart from the library, which loads this where the policy is thesis.

export * from './decide/thesis_list';
