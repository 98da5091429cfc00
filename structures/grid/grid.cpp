#include "structures/grid/grid.h"

#include <vector>

#include "core/error.h"
#include "core/timer.h"
#include "structures/archive.h"
#include "structures/grid/cell_counts.h"
#include "structures/grid/grid_builder.h"
#include "structures/leaves/leaf_names.h"
#include "structures/parameter_limits.h"

namespace arboretum::grid {
namespace {

Bounds3f cell_bounds(const Level& level, std::uint32_t number) {
  Bounds3f box;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::uint32_t i = number % level.cells_on(int(a));
    number /= level.cells_on(int(a));
    box.lower[a] = face(level, a, i), box.upper[a] = face(level, a, i + 1);
  }
  return box;
}

Bounds3f level_bounds(const Level& level) {
  Bounds3f box = cell_bounds(level, 0);
  box.extend(cell_bounds(level, std::uint32_t(level.size() - 1)));
  return box;
}

}  // namespace

const StructureInfo& Grid::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = "grid with 3-D DDA, one or two levels of cells";
    i.no_streams =
        "not built: a stream's rays share nodes until they are alone in them; in a grid rays that start anywhere share "
        "no cells";
    i.no_queue =
        "not built: a queue hides what a ray waits for from node to node; in a grid a ray's way through empty cells is "
        "arithmetic, and it waits at the cells that hold triangles alone";
    i.builders = {"two_level", "uniform"};
    i.root_is_node = true;
    i.leaves = all_leaf_names();
    return i;
  }();
  return info;
}

void Grid::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  const BuilderParameters& p = settings.parameters;
  require_triangles(kName, mesh.size());
  const LeafForm& form = require_leaf_form(kName, settings.leaf);
  if (settings.builder != "two_level" && settings.builder != "uniform") {
    throw UserError("grid: builder '" + settings.builder + "' is neither two_level nor uniform");
  }
  empty_ = mesh.size() == 0;
  Cells cells;
  if (empty_) {  // one cell, and nothing in it
    cells.levels.resize(1);
    cells.levels[0] = {};
    for (std::size_t a = 0; a < 3; ++a) cells.levels[0].cell[a] = cells.levels[0].inverse[a] = 1.0f;
    cells.codes.assign(1, kEmptyLeaf);
    cells.lists.begin.assign(2, 0);
  } else {
    build_cells(mesh, p, settings.builder == "two_level", form.width, cells, report);
  }
  const double start = wall_seconds();
  leaves_.fill(mesh, cells.lists, settings.leaf, kName, true, cells.codes.data());
  levels_ = std::move(cells.levels), codes_ = std::move(cells.codes);
  max_coordinate_ = cells.max_coordinate, pad_ = cells.pad, reach_ = cells.reach;
  report.phases.emplace_back("leaves", wall_seconds() - start);
}

std::size_t Grid::bytes() const noexcept {
  return levels_.size() * sizeof(Level) + codes_.size() * sizeof(LeafCode) + leaves_.bytes();
}

void Grid::archive(Archive& archive) {
  archive.expect(sizeof(Level));
  archive(levels_, codes_, max_coordinate_, pad_, reach_, empty_);
  leaves_.archive(archive);
}

bool Grid::visit(StructureVisitor& visitor) const {
  if (empty_) return true;
  with_block(leaves_.leaf(), [&]<class Block>(std::type_identity<Block>) {
    const auto* blocks = reinterpret_cast<const Block*>(leaves_.blocks());
    std::vector<bool> counted(leaves_.bytes() / sizeof(Block) + 1);  // shared blocks count once
    std::vector<std::uint32_t> primitives;
    // The grid in a cell has a box of its own, which is the cell's but for rounding.
    const auto bounds_of = [&](const Level& level, std::uint32_t c) {
      const LeafCode code = codes_[level.first + c];
      return (code & kLeafCountMask) == kNoLeaf && code != kEmptyLeaf ? level_bounds(levels_[code >> kLeafShift])
                                                                      : cell_bounds(level, c);
    };
    const auto show = [&](const auto& self, const Level& level, unsigned depth) -> void {
      std::vector<Bounds3f> children;
      for (std::uint32_t c = 0; c < level.size(); ++c)
        if (codes_[level.first + c] != kEmptyLeaf) children.push_back(bounds_of(level, c));
      visitor.node({level_bounds(level), children, depth, sizeof(Level) + level.size() * sizeof(LeafCode),
                    expected_steps(level)});
      for (std::uint32_t c = 0; c < level.size(); ++c) {
        const LeafCode code = codes_[level.first + c];
        if (code == kEmptyLeaf) continue;
        if ((code & kLeafCountMask) == kNoLeaf) {
          self(self, levels_[code >> kLeafShift], depth + 1);
          continue;
        }
        const LongLeaf range = leaves_.range(code);
        primitives.clear();
        append_primitives(blocks + range.first, range.blocks, primitives);
        visitor.leaf({cell_bounds(level, c), primitives, depth + 1, range.blocks, unsigned(Block::kWidth),
                      counted[range.first] ? 0 : range.blocks * sizeof(Block)});
        counted[range.first] = true;
      }
    };
    show(show, levels_[0], 0);
  });
  return true;
}

}  // namespace arboretum::grid
