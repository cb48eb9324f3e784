// Chapter 4 as printed, for planDelivery(). The library loads this part where the policy is thesis.

export * from './decide/thesis_list';
