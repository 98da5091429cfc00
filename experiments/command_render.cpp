#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "core/names.h"
#include "core/parse_number.h"
#include "core/timer.h"
#include "experiments/append_file.h"
#include "experiments/axis_words.h"
#include "experiments/commands.h"
#include "experiments/config_scenes.h"
#include "experiments/progress.h"
#include "rendering/heat_map.h"
#include "rendering/render.h"
#include "scenes/camera.h"
#include "scenes/sanitise.h"

namespace arboretum {
namespace {

/// `512x384`; empty: what the scene's camera prefers, made smaller to at most kLongestSide.
void set_resolution(const std::string& word, const Camera& camera, RenderSettings& settings) {
  constexpr unsigned kLongestSide = 640;
  if (word.empty()) {
    if (camera.width == 0 || camera.height == 0) return;
    const double shrink = std::min(1.0, double(kLongestSide) / std::max(camera.width, camera.height));
    settings.width = std::max(1u, unsigned(std::lround(camera.width * shrink)));
    settings.height = std::max(1u, unsigned(std::lround(camera.height * shrink)));
    return;
  }
  const std::size_t cross = word.find('x');
  const auto width = parse_number<unsigned>(std::string_view(word).substr(0, cross));
  const auto height =
      parse_number<unsigned>(cross == std::string::npos ? "" : std::string_view(word).substr(cross + 1));
  if (!width || !height) throw UserError(fmt::format("--resolution '{}' is no WIDTHxHEIGHT, as in 640x480", word));
  settings.width = *width, settings.height = *height;
  if (settings.width == 0 || settings.height == 0)
    throw UserError(fmt::format("--resolution {}: width and height must each be 1 or more, as in 640x480", word));
}

void refuse_doubled_effects(const std::string& list) {
  std::vector<std::string> names;
  std::istringstream stream(list);
  for (std::string name; std::getline(stream, name, ',');) names.push_back(name);
  refuse_doubled("--effects", names);
}

bool draws_light(Integrator integrator) { return integrator == Integrator::path || integrator == Integrator::whitted; }

/// Nothing: automatic.
std::optional<double> parse_exposure(const std::string& word, Integrator integrator) {
  if (word.empty() && !draws_light(integrator)) return 0.0;  // values within [0, 1] that mean the same in every picture
  if (word.empty() || word == "auto") return std::nullopt;
  const bool has_plus = word.size() > 1 && word[0] == '+' && word[1] != '-';  // as the exposure is printed
  const std::optional<double> stops = parse_number<double>(std::string_view(word).substr(has_plus ? 1 : 0));
  if (!stops || !std::isfinite(*stops))
    throw UserError(fmt::format("--exposure '{}' is neither 'auto' nor a number of stops", word));
  check_exposure(*stops);
  return stops;
}

/// What knows no light simulates no effect of light.
bool takes_part(EffectKind kind, Integrator integrator) {
  if (integrator == Integrator::path) return true;
  if (integrator == Integrator::whitted) return kind != EffectKind::diffuse_gi;
  return kind == EffectKind::dof || kind == EffectKind::motion_blur || kind == EffectKind::alpha_cutout ||
         kind == EffectKind::instancing;
}

/// What is said of paths where none are followed would change nothing.
void set_paths(const RenderCommand& command, RenderSettings& settings) {
  if (!draws_light(settings.integrator) && (command.depth || command.clamp))
    throw UserError(fmt::format(
        "{} has no effect: {} follows no paths{}; take it out, or choose --integrator path",
        command.depth ? "--depth" : "--clamp", to_string(settings.integrator),
        command.integrator.empty() || command.integrator == "auto" ? ", and nothing in the scene emits light" : ""));
  settings.depth = command.depth.value_or(settings.depth), settings.clamp = command.clamp.value_or(settings.clamp);
}

/// Without a light in it a scene is black; its shape can be seen all the same.
Integrator chosen_integrator(const std::string& word, const std::vector<Effect>& effects) {
  if (!word.empty() && word != "auto") return parse_integrator(word);
  return is_lit(called_for(effects)) ? Integrator::path : Integrator::ambient_occlusion;
}

/// A picture without light is black, and a user may wonder why; empty where something shines.
std::string why_dark(const std::vector<Effect>& effects, EffectSet simulated, Integrator integrator) {
  if (!draws_light(integrator)) return {};
  const EffectSet lights = called_for(effects);
  if (!is_lit(lights))
    return fmt::format(
        "nothing in the scene emits light, so {} draws it black; take --integrator ambient_occlusion or normals, or "
        "give "
        "it lights, an environment or a material with Ke (docs/scenes.md)",
        to_string(integrator));
  for (const EffectKind kind : {EffectKind::shadow_hard, EffectKind::shadow_soft, EffectKind::env_light})
    if (lights.has(kind) && simulated.has(kind)) return {};
  return "--effects leaves out all light that the scene has, so the picture is black";
}

EffectSet simulated(EffectSet chosen, Integrator integrator) {
  for (std::size_t i = 0; i < kEffectNames.size(); ++i)
    if (!takes_part(EffectKind(i), integrator)) chosen = chosen.without(EffectKind(i));
  return chosen;
}

void print_effects(const std::vector<Effect>& effects, EffectSet chosen, EffectSet simulated, Integrator integrator) {
  fmt::print("effects\n");
  for (std::size_t i = 0; i < effects.size(); ++i) {
    const Effect& e = effects[i];
    const bool on = simulated.has(EffectKind(i));
    if (on && e.called_for)
      fmt::print("  + {:<13} {}\n", e.name, e.reason);
    else if (on)
      fmt::print("  + {:<13} as asked, though the scene does not call for it: {}\n", e.name, e.reason);
    else if (e.called_for && !takes_part(EffectKind(i), integrator))
      fmt::print("  - {:<13} no part of {}; the scene has {}\n", e.name, to_string(integrator), e.reason);
    else if (!e.called_for && chosen.has(EffectKind(i)))
      fmt::print("  - {:<13} no part of {}, though asked for; {}\n", e.name, to_string(integrator), e.reason);
    else if (e.called_for)
      fmt::print("  - {:<13} LEFT OUT as asked, though the scene calls for it: {}\n", e.name, e.reason);
    else
      fmt::print("  - {:<13} {}\n", e.name, e.reason);
  }
}

std::string threads_in_words(unsigned threads) {
  return threads == 0 ? "a thread a core" : fmt::format("{} thread{}", threads, threads == 1 ? "" : "s");
}

void print_rays(const RenderStatistics& statistics) {
  fmt::print("rays                     rays   CPU ms   Mray/s\n");
  const auto line = [](std::string_view name, const RenderStatistics::Rays& r) {
    fmt::print("  {:<17} {:>9} {:>8.1f} {:>8.2f}\n", name, r.rays, 1e3 * r.seconds,
               r.seconds > 0.0 ? 1e-6 * double(r.rays) / r.seconds : 0.0);
  };
  for (std::size_t i = 0; i < kRayKindNames.size(); ++i)
    if (statistics.of[i].rays > 0) line(kRayKindNames[i], statistics.of[i]);
  const RenderStatistics::Rays total = statistics.total();
  line("all", total);
  fmt::print("  {:<17} {:>9} {:>8.1f}\n", "shading", "", 1e3 * std::max(0.0, statistics.seconds - total.seconds));
}

/// A line that is written over, on a terminal; nothing elsewhere.
class Bar {
 public:
  Bar() : terminal_(::isatty(STDERR_FILENO) == 1), begin_(wall_seconds()) {}
  Bar(const Bar&) = delete;
  Bar& operator=(const Bar&) = delete;
  ~Bar() {
    if (terminal_) fmt::print(stderr, "\r\033[K");
  }
  void operator()(double done) {
    const double now = wall_seconds();
    if (!terminal_ || (now - drawn_ < 0.1 && done < 1.0)) return;
    drawn_ = now;
    fmt::print(stderr, "\r\033[K{:>4.0f} %  {} left", 100.0 * done,
               format_duration((now - begin_) * (1.0 - done) / std::max(done, 1e-3)));
    std::fflush(stderr);
  }

 private:
  bool terminal_;
  double begin_, drawn_ = 0.0;
};

/// Where no light is drawn most effects are none, and a list of such alone is likely a mistake.
void note_idle_effects(const RenderCommand& command, EffectSet set, EffectSet called_for, Integrator integrator) {
  if (draws_light(integrator) || command.effects == "auto" || set != simulated(called_for, integrator)) return;
  fmt::print(stderr,
             "--effects {} changes nothing: {} has no part for effects but dof, motion_blur, alpha_cutout and "
             "instancing\n",
             command.effects, to_string(integrator));
}

/// Of the loading.
void print_warnings(const LoadReport& report) {
  if (const std::string dropped = dropped_in_words(report); !dropped.empty()) fmt::print("warning       {}\n", dropped);
  for (const std::string& warning : report.warnings) fmt::print("warning       {}\n", warning);
}

/// The work of the camera's rays in place of light.
void render_heat_map(const RenderCommand& command, const Scene& scene, RenderSettings settings,
                     const std::filesystem::path& out) {
  const HeatCount what = parse_heat_count(command.heat_map);
  if (out.extension() != ".png") throw UserError(fmt::format("{}: heat maps are written as .png", out.string()));
  const std::string unit = command.heat_map + " a ray";
  const auto [width, height] = drawn_size_at_most(settings.width, settings.height, unit);
  check_png_size(width, height);
  // Of all effects these two alone change what a ray through a pixel's centre meets.
  constexpr EffectSet kPart = EffectSet{}.with(EffectKind::motion_blur).with(EffectKind::instancing);
  const EffectSet chosen = parse_effects(command.effects, called_for(effects_of(scene)));
  EffectSet set = chosen;
  std::vector<std::string_view> no_part;
  for (std::size_t i = 0; i < kEffectNames.size(); ++i) {
    if (kPart.has(EffectKind(i))) continue;
    set = set.without(EffectKind(i));
    if (command.effects != "auto" && chosen.has(EffectKind(i))) no_part.push_back(kEffectNames[i]);
  }
  const RenderScene ready(scene, set);
  KernelChoice choice = command.kernel;
  const bool was_auto = choice.traversal == "auto";
  if (was_auto) choice.traversal = "single";  // each pixel's ray is to visit what it visits alone
  const BuiltKernel built = build_kernel(choice, ready.mesh(), this_registry());
  const HeatMap map = count_work(BatchTracer(ready, *built.accel, *built.kernel), settings, what);
  const DrawnPicture picture = draw(map, unit);
  fmt::print("scene         {}, {} triangles\n", scene.name, scene.mesh.size());
  fmt::print("kernel        {}, built in {:.3f} s{}\n", built.name(), built.report.seconds,
             was_auto ? "; heat maps take single rays where the traversal is auto" : "");
  print_warnings(scene.report);
  if (!no_part.empty())
    fmt::print("effects       no part of heat maps, though asked for: {}\n", fmt::join(no_part, ", "));
  fmt::print("heat map      {} a camera ray: mean {:.2f}, median {}, most {}; the brightest colour is {}\n",
             command.heat_map, map.mean, map.median, map.most, map.top);
  flush_output();
  write_png(out, picture.width, picture.height, picture.rgb);
  fmt::print("picture       {} ({} x {} rays)\n", out.string(), map.width, map.height);
}

}  // namespace

ExitStatus command_render(const RenderCommand& command) {
  const std::filesystem::path out = command.out.empty() ? "image.png" : command.out;
  check_picture_path(out);
  refuse_doubled_effects(command.effects);
  static_cast<void>(parse_exposure(command.exposure, Integrator::path));  // before the scene is read
  if (!command.exposure.empty() && out.extension() == ".pfm")
    throw UserError(fmt::format("--exposure has no effect: {} holds the radiance itself; take it out, or write a .png",
                                out.string()));
  const Scene scene = load_scene(scene_spec_of_word(command.scene));
  const std::vector<Effect> effects = effects_of(scene);
  RenderSettings settings = command.settings;
  settings.integrator = chosen_integrator(command.integrator, effects);
  set_paths(command, settings);
  set_resolution(command.resolution, view_of(scene), settings);
  check(settings);
  if (!command.heat_map.empty()) {
    render_heat_map(command, scene, settings, out);
    return ExitStatus::kDone;
  }
  if (out.extension() == ".png") check_png_size(settings.width, settings.height);
  const std::optional<double> exposure = parse_exposure(command.exposure, settings.integrator);
  const EffectSet chosen = parse_effects(command.effects, called_for(effects)),
                  set = simulated(chosen, settings.integrator);
  const RenderScene ready(scene, set);
  const BuiltKernel built = build_kernel(command.kernel, ready.mesh(), this_registry());
  fmt::print("scene         {}, {} triangles\n", scene.name, scene.mesh.size());
  fmt::print("integrator    {}, {} x {}, {} sample{} a pixel, seed {}, {}\n", to_string(settings.integrator),
             settings.width, settings.height, settings.samples, settings.samples == 1 ? "" : "s", settings.seed,
             threads_in_words(settings.threads));
  if (draws_light(settings.integrator))
    fmt::print("paths         depth {}, {}\n", settings.depth,
               std::isinf(settings.clamp) ? "no clamp" : fmt::format("clamp {}", settings.clamp));
  fmt::print("kernel        {}, built in {:.3f} s\n", built.name(), built.report.seconds);
  print_warnings(scene.report);
  for (const std::string& warning : ready.warnings()) fmt::print("warning       {}\n", warning);
  if (const std::string why = why_dark(effects, set, settings.integrator); !why.empty())
    fmt::print("warning       {}\n", why);
  print_effects(effects, chosen, set, settings.integrator);
  flush_output();
  note_idle_effects(command, set, called_for(effects), settings.integrator);

  const BatchTracer tracer(ready, *built.accel, *built.kernel);
  RenderStatistics statistics;
  const double begin = wall_seconds();
  Bar bar;
  const Picture picture = render(tracer, settings, statistics, [&](double done) { bar(done); });
  const double seconds = wall_seconds() - begin;
  const double stops = exposure.value_or(auto_exposure(picture));
  print_rays(statistics);
  if (statistics.not_finite > 0)
    fmt::print("warning       {} samples were no finite number and are left out\n", statistics.not_finite);
  flush_output();
  write_picture(out, picture, stops);
  const std::string developed = out.extension() == ".pfm"
                                    ? std::string("radiance")
                                    : fmt::format("{}exposure {:+.2f} stops", exposure ? "" : "automatic ", stops);
  fmt::print("picture       {} ({}; {:.2f} s)\n", out.string(), developed, seconds);
  return ExitStatus::kDone;
}

}  // namespace arboretum
