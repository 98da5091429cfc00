// A sphere of triangles and the rays of a picture of it, traced one at a time, in packets of 16 and as one batch: the
// three give the same hits, bit for bit. Prints what each way costs against the batch. Exit status 1 where anything is
// wrong.
//
// usage: sphere [rings] [structure]
#include <arboretum/arboretum.h>

#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

namespace {

constexpr int kSize = 512;  // pixels a side
constexpr std::size_t kPacket = 16;

/// Unit sphere: `rings` latitudes, twice as many longitudes; about 4 rings^2 triangles.
arboretum::TriangleMesh make_sphere(unsigned rings) {
  std::vector<float> coordinates;
  std::vector<std::uint32_t> indices;
  const unsigned around = 2 * rings;
  const double pi = std::acos(-1.0);
  for (unsigned r = 0; r <= rings; ++r) {
    for (unsigned k = 0; k < around; ++k) {
      const double theta = pi * r / rings, phi = 2 * pi * k / around;
      for (double x : {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)})
        coordinates.push_back(float(x));
    }
  }
  for (unsigned r = 0; r < rings; ++r) {
    for (unsigned k = 0; k < around; ++k) {
      const unsigned a = r * around + k, b = r * around + (k + 1) % around, c = a + around, d = b + around;
      if (r > 0) indices.insert(indices.end(), {a, c, b});
      if (r + 1 < rings) indices.insert(indices.end(), {b, c, d});
    }
  }
  return arboretum::make_mesh(coordinates, indices);
}

/// One ray a pixel from (0, 0, -3), in tiles of 4 x 4: rays of a tile meet the same triangles, and make a packet.
std::vector<arboretum::Ray> make_rays() {
  std::vector<arboretum::Ray> rays;
  for (int tile = 0; tile < kSize * kSize / 16; ++tile) {
    for (int i = 0; i < 16; ++i) {
      const int x = tile % (kSize / 4) * 4 + i % 4, y = tile / (kSize / 4) * 4 + i / 4;
      const float u = (2.0f * float(x) + 1.0f) / kSize - 1.0f, v = (2.0f * float(y) + 1.0f) / kSize - 1.0f;
      rays.push_back({.origin = {0, 0, -3}, .direction = {0.4f * u, 0.4f * v, 1.0f}});
    }
  }
  return rays;
}

double thread_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

void one_at_a_time(const arboretum::Tracer& tracer, const std::vector<arboretum::Ray>& rays,
                   std::vector<arboretum::Hit>& hits) {
  for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = tracer.closest_hit(rays[i]);
}

void in_packets(const arboretum::Tracer& tracer, const std::vector<arboretum::Ray>& rays,
                std::vector<arboretum::Hit>& hits) {
  for (std::size_t i = 0; i < rays.size(); i += kPacket) {
    std::array<arboretum::Ray, kPacket> packet;
    std::copy_n(&rays[i], kPacket, packet.begin());
    const auto answers = tracer.closest_hit(packet);
    std::copy_n(answers.begin(), kPacket, &hits[i]);
  }
}

int run(unsigned rings, const char* structure) {
  arboretum::TracerSettings settings;
  settings.structure = structure;
  if (settings.structure == "embree") settings.intersector = "pluecker";
  const arboretum::Tracer tracer(make_sphere(rings), settings);
  std::printf("%zu triangles in %s (%s, %s, %s boxes, %s): %.1f MiB, built in %.1f ms\n", tracer.mesh().size(),
              structure, tracer.settings().leaf.c_str(), tracer.settings().intersector.c_str(),
              tracer.settings().box.c_str(), tracer.settings().isa.c_str(), double(tracer.structure().bytes()) / 0x1p20,
              tracer.report().seconds * 1e3);

  const std::vector<arboretum::Ray> rays = make_rays();
  std::array<std::vector<arboretum::Hit>, 3> hits;
  std::array<std::vector<double>, 3> seconds;
  for (auto& h : hits) h.resize(rays.size());
  for (int repetition = 0; repetition < 7; ++repetition) {
    const double start = thread_seconds();
    tracer.closest_hit(rays, hits[0]);
    const double batch = thread_seconds();
    in_packets(tracer, rays, hits[1]);
    const double packets = thread_seconds();
    one_at_a_time(tracer, rays, hits[2]);
    const double single = thread_seconds();
    seconds[0].push_back(batch - start), seconds[1].push_back(packets - batch), seconds[2].push_back(single - packets);
  }
  for (auto& s : seconds) std::nth_element(s.begin(), s.begin() + 3, s.end());
  std::printf("batch %.1f Mray/s; time against it: packets of %zu %.2f, one ray at a time %.2f\n",
              1e-6 * double(rays.size()) / seconds[0][3], kPacket, seconds[1][3] / seconds[0][3],
              seconds[2][3] / seconds[0][3]);

  int wrong = 0;
  std::size_t found = 0;
  const float chord = 8.0f / float(rings * rings);  // how far inside the sphere a triangle may lie
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const arboretum::Hit& hit = hits[0][i];
    for (const auto& other : hits) wrong += std::memcmp(&other[i], &hit, sizeof hit) != 0;
    wrong += tracer.any_hit(rays[i]) != hit.is_hit();
    if (!hit.is_hit()) continue;
    ++found;
    wrong += std::abs(length(rays[i].origin + hit.t * rays[i].direction) - 1.0f) > chord;
  }
  // The sphere covers the pixels within sin(angle) = 1/3: a disc of radius tan(asin(1/3)) = 0.35355 of the picture's
  // 0.4.
  const double expected = std::acos(-1.0) * 0.125 / (4 * 0.16) * kSize * kSize;
  wrong += std::abs(double(found) - expected) > 0.02 * expected;
  std::printf("%zu of %zu rays hit, %d wrong\n", found, rays.size(), wrong);
  return wrong == 0 && found > 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc > 1 ? unsigned(std::max(4, std::atoi(argv[1]))) : 64, argc > 2 ? argv[2] : "bvh8");
  } catch (const arboretum::UserError& e) {
    std::fprintf(stderr, "sphere: %s\n", e.what());
    return 2;
  }
}
