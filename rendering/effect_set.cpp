#include "rendering/effect_set.h"

#include <algorithm>

#include "core/error.h"
#include "core/names.h"

namespace arboretum {

EffectSet called_for(const std::vector<Effect>& effects) {
  EffectSet set;
  for (std::size_t i = 0; i < kEffectNames.size(); ++i) {
    const auto found = std::ranges::find(effects, kEffectNames[i], &Effect::name);
    if (found != effects.end() && found->called_for) set = set.with(EffectKind(i));
  }
  return set;
}

namespace {

std::string trimmed(const std::string& word) {
  const std::size_t begin = word.find_first_not_of(" \t"), end = word.find_last_not_of(" \t");
  return begin == std::string::npos ? std::string{} : word.substr(begin, end - begin + 1);
}

}  // namespace

EffectSet parse_effects(const std::string& words, EffectSet called_for) {
  if (trimmed(words) == "auto") return called_for;
  if (trimmed(words) == "all") return EffectSet::all();
  EffectSet set;
  for (std::size_t begin = 0; begin <= words.size();) {
    const std::size_t end = std::min(words.find(',', begin), words.size());
    const std::string word = trimmed(words.substr(begin, end - begin));
    if (word.empty()) throw UserError("effects '" + words + "' have an empty name");
    if (word == "auto" || word == "all") throw UserError("effects '" + words + "': '" + word + "' stands alone");
    const auto found = std::ranges::find(kEffectNames, word);
    if (found == kEffectNames.end()) {
      std::vector<std::string> valid{"auto", "all"};
      valid.insert(valid.end(), kEffectNames.begin(), kEffectNames.end());
      throw UserError(unknown_name_message("effect", word, valid));
    }
    set = set.with(EffectKind(found - kEffectNames.begin()));
    begin = end + 1;
  }
  return set;
}

}  // namespace arboretum
