// TypeList: a list of types, for tables that the compiler fills in.
#pragma once

#include <cstddef>
#include <type_traits>

namespace arboretum {

template <class... Ts>
struct TypeList {
  static constexpr std::size_t kSize = sizeof...(Ts);
};

namespace detail {
template <class... Lists>
struct Concat;
template <>
struct Concat<> {
  using Type = TypeList<>;
};
template <class... Ts>
struct Concat<TypeList<Ts...>> {
  using Type = TypeList<Ts...>;
};
template <class... Ts, class... Us, class... Rest>
struct Concat<TypeList<Ts...>, TypeList<Us...>, Rest...> {
  using Type = typename Concat<TypeList<Ts..., Us...>, Rest...>::Type;
};
}  // namespace detail

/// One list of all the lists' types, in order.
template <class... Lists>
using ConcatLists = typename detail::Concat<Lists...>::Type;

/// Calls f(std::type_identity<T>{}) for each T of the list, in order.
template <class... Ts, class F>
constexpr void for_each_type(TypeList<Ts...>, F&& f) {
  (f(std::type_identity<Ts>{}), ...);
}

/// A value as a type, so that numbers can stand in a TypeList.
template <auto V>
struct Value {
  static constexpr auto value = V;
};

}  // namespace arboretum
