const foveaRadiusDegrees = 0.5;
const halfAcuityDegrees = 2.3;

/**
 * What somebody resolves so many degrees beside the point that they look at, as a part of what they resolve at that point: 1 in the
 * fovea, the central degree; outside of it the finest detail that is seen grows in proportion to the distance and has doubled 2.3
 * degrees beyond. The same bits as delivery/cpp/decide/acuity.h.
 */
export function acuityAt(degrees: number): number {
  return halfAcuityDegrees / (halfAcuityDegrees + Math.max(0, degrees - foveaRadiusDegrees));
}
/** What a loss counts there: the square, since detail is lost in two directions. */
export function gazeWeight(degrees: number): number {
  const acuity = acuityAt(degrees);
  return acuity * acuity;
}
