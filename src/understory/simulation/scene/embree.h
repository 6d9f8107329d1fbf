#pragma once

// Embree 3 (Debian 12) and 4 (Debian 13 on) differ in the header's folder and in how the arguments
// of a ray query are passed. Everything else uses the calls that both have.
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
namespace understory {
inline void embree_intersect16(const int* valid, RTCScene scene, RTCRayHit16* rays) {
  rtcIntersect16(valid, scene, rays, nullptr);
}
inline void embree_intersect1(RTCScene scene, RTCRayHit* ray) {
  rtcIntersect1(scene, ray, nullptr);
}
inline void embree_occluded1(RTCScene scene, RTCRay* ray) {
  rtcOccluded1(scene, ray, nullptr);
}
}  // namespace understory
#else
#include <embree3/rtcore.h>
namespace understory {
inline void embree_intersect16(const int* valid, RTCScene scene, RTCRayHit16* rays) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect16(valid, scene, &context, rays);
}
inline void embree_intersect1(RTCScene scene, RTCRayHit* ray) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, ray);
}
inline void embree_occluded1(RTCScene scene, RTCRay* ray) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, ray);
}
}  // namespace understory
#endif
