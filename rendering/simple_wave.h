// The integrators that know no light: normals and ambient occlusion, one camera ray a sample and at most one more.
#pragma once

#include <span>

#include "rendering/batch_tracer.h"
#include "rendering/render.h"
#include "scenes/vec3d.h"

namespace arboretum {

/// The geometric normal n on the viewer's side as (n + 1) / 2; black where nothing is.
void trace_normals(const BatchTracer& tracer, const TracedRays& camera_rays, std::span<Vec3d> radiance,
                   RenderStatistics& statistics);
/// 1 where a cosine-distributed ray as long as a fifth of the scene's diagonal meets nothing, else 0; 0 where nothing
/// is.
void trace_ambient_occlusion(const BatchTracer& tracer, const TracedRays& camera_rays, std::span<Vec3d> radiance,
                             RenderStatistics& statistics);

}  // namespace arboretum
