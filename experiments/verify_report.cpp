#include "experiments/verify_report.h"

#include <fmt/format.h>

#include <algorithm>

#include "experiments/table_text.h"

namespace arboretum {
namespace {

struct Group {
  std::string intersector, box;
  std::vector<const VerifiedCell*> cells;
};

std::vector<Group> grouped(const std::vector<VerifiedCell>& cells) {
  std::vector<Group> groups;
  for (const VerifiedCell& c : cells) {
    auto group = std::ranges::find_if(
        groups, [&](const Group& g) { return g.intersector == c.cell.intersector && g.box == c.cell.box; });
    if (group == groups.end()) group = groups.insert(group, {c.cell.intersector, c.cell.box, {}});
    group->cells.push_back(&c);
  }
  return groups;
}

std::string error_text(double error) {
  if (error == 0) return "0";
  return error < 1e-3 || error >= 1e5 ? fmt::format("{:.0e}", error) : fmt::format("{:.3g}", error);
}

TableRow row_of(const VerifiedCell& verified) {
  const Cell& c = verified.cell;
  const VerifyTally t = verified.sum();
  std::string cases = fmt::format("{}", fmt::join(verified.wrong_cases, " "));
  return {c.structure,
          c.builder_name(),
          c.leaf,
          c.traversal,
          std::string(to_string(c.isa)),
          std::to_string(t.rays),
          std::to_string(t.missed),
          std::to_string(t.false_hits),
          std::to_string(t.wrong_surface),
          std::to_string(t.wrong_primitive),
          std::to_string(t.cracks),
          fmt::format("{}/{}", t.any_missed, t.any_false),
          std::to_string(t.self_hits),
          std::to_string(t.differs),
          error_text(t.t_ulp.quantile(0.5)),
          error_text(t.t_ulp.quantile(0.99)),
          error_text(t.t_ulp.max()),
          error_text(t.uv.quantile(0.99)),
          !verified.promise.any() ? "-"
          : t.broken == 0         ? "kept"
                                  : fmt::format("BROKEN {}", t.broken),
          cases};
}

std::string kinds_table(const std::vector<Group>& groups) {
  std::vector<TableRow> rows{{"per million: wrong (cracks)", "box"}};
  std::vector<std::size_t> kinds;
  for (std::size_t k = 0; k < kHardKindNames.size(); ++k) {
    const bool used = std::ranges::any_of(groups, [k](const Group& g) {
      return std::ranges::any_of(g.cells.front()->tallies, [k](const auto& variant) { return variant[k].rays > 0; });
    });
    if (used) kinds.push_back(k), rows[0].emplace_back(kHardKindNames[k]);
  }
  for (const Group& group : groups) {
    rows.push_back({group.intersector, group.box});
    for (std::size_t k : kinds) {
      std::uint64_t rays = 0, wrong = 0, cracks = 0;
      for (const VerifiedCell* c : group.cells)
        for (const auto& variant : c->tallies)
          rays += variant[k].rays, wrong += variant[k].wrong(), cracks += variant[k].cracks;
      const auto rate = [rays](std::uint64_t n) {
        return n == 0 ? std::string("0") : fmt::format("{:.4g}", 1e6 * double(n) / double(rays));
      };
      rows.back().push_back(rays == 0 ? "-" : fmt::format("{} ({})", rate(wrong), rate(cracks)));
    }
  }
  return "\n" + format_table(rows, 2);
}

std::string numbers(Vec3f p) { return fmt::format("({}, {}, {})", p.x, p.y, p.z); }

}  // namespace

std::string cell_label(const Cell& c) {
  return fmt::format("{}/{}/{}/{}/{}/{}/{}", c.structure, c.builder_name(), c.leaf, c.intersector, c.box, c.traversal,
                     to_string(c.isa));
}

std::string verify_tables(const std::vector<VerifiedCell>& cells, bool by_kind) {
  std::string text;
  const std::vector<Group> groups = grouped(cells);
  for (const Group& group : groups) {
    std::vector<TableRow> rows{{"structure", "builder", "leaf",      "traversal", "isa",     "rays", "missed",
                                "false",     "surface", "primitive", "cracks",    "any",     "self", "differs",
                                "t med",     "t p99",   "t max",     "uv p99",    "promise", ""}};
    for (const VerifiedCell* c : group.cells) rows.push_back(row_of(*c));
    text += fmt::format("\n{}, {} boxes; promised: {}\n{}", group.intersector, group.box,
                        to_words(promise_of("", group.intersector, group.box)), format_table(rows, 5));
  }
  if (by_kind) text += kinds_table(groups);
  return text +
         "\nmissed, false, surface, primitive, cracks: as docs/numerics.md defines them. any: missed/false of any hit. "
         "self: hits of the "
         "triangle that the ray starts on. differs: from the first cell of the same intersector, boxes and ISA. t: "
         "error in ulp; uv: "
         "absolute.\n";
}

std::string verify_csv(const std::vector<VerifiedCell>& cells, const std::vector<VerifyVariant>& variants) {
  std::string text =
      "structure,builder,leaf,intersector,box,traversal,isa,offset,scale_exponent,kind,rays,exact_hits,missed_hits,"
      "false_hits,"
      "wrong_surface,wrong_primitive,cracks,any_missed,any_false,self_hits,differs,t_error_ulp_median,t_error_ulp_p99,"
      "t_error_ulp_max,uv_error_median,uv_error_p99,uv_error_max,promise,broken\n";
  for (const VerifiedCell& v : cells) {
    for (std::size_t i = 0; i < v.tallies.size(); ++i) {
      for (std::size_t k = 0; k < v.tallies[i].size(); ++k) {
        const VerifyTally& t = v.tallies[i][k];
        if (t.rays == 0) continue;
        const Cell& c = v.cell;
        text +=
            fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},\"{}\",{}\n",
                        c.structure, c.builder_name(), c.leaf, c.intersector, c.box, c.traversal, to_string(c.isa),
                        variants[i].offset, variants[i].exponent, kHardKindNames[k], t.rays, t.exact_hits, t.missed,
                        t.false_hits, t.wrong_surface, t.wrong_primitive, t.cracks, t.any_missed, t.any_false,
                        t.self_hits, t.differs, t.t_ulp.quantile(0.5), t.t_ulp.quantile(0.99), t.t_ulp.max(),
                        t.uv.quantile(0.5), t.uv.quantile(0.99), t.uv.max(), to_words(v.promise), t.broken);
      }
    }
  }
  return text;
}

std::string describe_breach(const VerifiedCell& cell, const VerifyTally& sum) {
  const Breach& b = sum.first;
  const auto hit = [](const Hit& h) {
    return h.is_hit() ? fmt::format("t {}, primitive {}", h.t, h.primitive) : std::string("miss");
  };
  return fmt::format(
      "{}: {} of {} rays break the promise; the first: {}: {} ray {}, origin {}, direction {}, tnear {}, tfar {}; "
      "exact: {}; "
      "closest hit: {}; any hit: {}",
      cell_label(cell.cell), sum.broken, sum.rays, b.what, to_string(b.kind), b.ray, numbers(b.given.origin),
      numbers(b.given.direction), b.given.tnear, b.given.tfar, hit(b.truth.hit), hit(b.answer), b.any ? "hit" : "miss");
}

}  // namespace arboretum
