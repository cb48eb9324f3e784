#include "pipeline/import/placed_annotations.h"

#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "pipeline/import/up_axis.h"

namespace texmesh {

std::string placed_annotations(const std::string& json, const About& source, UpAxis up, Vec3d origin,
                               const Box3d& box, Notes& notes) {
  if (json.empty()) return "";
  Annotations all = read_annotations(text_bytes(json), kAnnotationsPath);
  if (all.frame == AnnotationFrame::kSource) {
    const auto turn = [axis = turned_axis(source, up)](Vec3d v) { return turned_up(v, axis); };
    transform_annotations(
        all, [&](Vec3d p) { return turn(p) - origin; }, turn);
    all.frame = AnnotationFrame::kPackage;
  }
  if (const auto outside = annotations_outside(all, box); !outside.empty())
    add_warning(notes, "annotations-outside", kAnnotationsPath,
                std::to_string(outside.size()) + " of " + std::to_string(all.list.size()) +
                    " notes lie outside the object, the first is note " + std::to_string(outside.front()) +
                    "; coordinates are to be those of the source file");
  return write_annotations(all);
}

}  // namespace texmesh
