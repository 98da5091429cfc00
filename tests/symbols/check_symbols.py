#!/usr/bin/env python3
"""No code of an instruction set may leave the namespace of that instruction set.

An inline function or template that a kernel unit compiles for AVX-512 is a weak symbol. If baseline code has one of the
same name, the linker keeps either of the two, and a machine without AVX-512 dies of an illegal instruction somewhere
else entirely. So in the given objects and archives, a function whose (mangled) name does not hold isa_sse, isa_avx2 or
isa_avx512 may have no instruction beyond x86-64's baseline (SSE2). This includes static initialisers, which run before
any check of the CPU.

usage: check_symbols.py [--expect-leak NAME] FILE...     (nm and objdump as $NM and $OBJDUMP, else from the PATH)
With --expect-leak the check passes only if exactly that function is reported: how it is tested itself.
"""
import os
import re
import subprocess
import sys

ISA_NAMESPACE = re.compile(r"isa_(sse|avx2|avx512)")
FUNCTION = re.compile(r"^[0-9a-f]+ <(.+)>:$")
# What objdump, GNU or LLVM, prints of an instruction without its bytes: the address, prefixes, the mnemonic, the operands.
INSTRUCTION = re.compile(r"^\s+[0-9a-f]+:\s+(?:(?:lock|rep[nz]*|repz|repnz|data16|cs|notrack|bnd) )*([a-z0-9.]+)(?:\s+(.*))?$")
# VEX and EVEX encodings and mask registers; BMI and the counts that SSE2 machines lack (tzcnt is not here: baseline code
# uses its encoding for bsf); SSE3 to SSE4.2.
VEX = re.compile(r"^(v(?!err|erw)[a-z0-9]+|k(add|and|andn|mov|not|or|ortest|shift[lr]|test|unpck|xnor|xor)[bwdq]+)$")
BIT_MANIPULATION = re.compile(r"^(andn|bextr|bls(i|r|msk)|bzhi|lzcnt|popcnt|mulx|pdep|pext|rorx|sarx|shlx|shrx)[lq]?$")
LATER_SSE = re.compile(
    r"^(addsubp[sd]|haddp[sd]|hsubp[sd]|lddqu|movddup|movs[hl]dup|pshufb|phadd(w|d|sw)|phsub(w|d|sw)|pmaddubsw|pmulhrsw|"
    r"psign[bwd]|pabs[bwd]|palignr|blendv?p[sd]|pblend(w|vb)|dpp[sd]|extractps|insertps|movntdqa|mpsadbw|packusdw|"
    r"pcmp(eq|gt)q|pcmp[ei]str[im]|pextr[bdq]|pinsr[bdq]|phminposuw|pmax(sb|sd|uw|ud)|pmin(sb|sd|uw|ud)|pmov[sz]x[a-z]+|"
    r"pmuldq|pmulld|ptest|round[ps][sd]|crc32[bwlq]?)$")


def run(command):
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"check_symbols: {' '.join(command[:3])} failed: {result.stderr.strip()}")
    return result.stdout


def beyond_baseline(mnemonic):
    return bool(VEX.match(mnemonic) or BIT_MANIPULATION.match(mnemonic) or LATER_SSE.match(mnemonic))


def leaks(path):
    """The functions of one file that break the rule: {mangled name: first offending instruction}, and how many were seen."""
    text = run([os.environ.get("OBJDUMP", "objdump"), "-d", "--no-show-raw-insn", "-w", path])
    found, functions, isa_functions, name = {}, 0, 0, None
    for line in text.splitlines():
        function = FUNCTION.match(line)
        if function:
            name = function.group(1)
            functions += 1
            isa_functions += bool(ISA_NAMESPACE.search(name))
            if ISA_NAMESPACE.search(name):
                name = None
            continue
        if name is None or name in found:
            continue
        instruction = INSTRUCTION.match(line)
        if instruction and beyond_baseline(instruction.group(1)):
            found[name] = line.strip().replace("\t", " ")
    return found, functions, isa_functions


def weak_outside(path):
    """Weak symbols outside the namespaces: harmless while they are baseline code, but worth a look."""
    names = set()
    for line in run([os.environ.get("NM", "nm"), "--defined-only", path]).splitlines():
        parts = line.split()
        if len(parts) == 3 and parts[1] in "WVu" and not re.search("isa_(scalar|sse|avx2|avx512)", parts[2]):
            names.add(parts[2])
    return names


def demangle(name):
    return subprocess.run(["c++filt", name], capture_output=True, text=True).stdout.strip() or name


def main(arguments):
    expected = None
    if arguments[:1] == ["--expect-leak"]:
        expected, arguments = arguments[1], arguments[2:]
    if not arguments:
        sys.exit(__doc__)
    found, functions, isa_functions, weak = {}, 0, 0, set()
    for path in arguments:
        leaked, seen, of_isas = leaks(path)
        found.update({name: (path, instruction) for name, instruction in leaked.items()})
        functions += seen
        isa_functions += of_isas
        weak |= weak_outside(path)
    print(f"{functions} functions, {isa_functions} of them of an instruction set's namespace; "
          f"{len(weak)} weak symbols outside, {len(found)} of all outside with instructions beyond SSE2")
    for name, (path, instruction) in sorted(found.items()):
        print(f"  {demangle(name)}\n    in {os.path.basename(path)}: {instruction}")
    if expected is not None:
        reported = [demangle(name) for name in found]
        if len(reported) == 1 and expected in reported[0]:
            print("the planted leak was found")
            return 0
        print(f"the check should have reported {expected} alone")
        return 1
    if isa_functions == 0:
        print("no function of an instruction set was seen: wrong files?")
        return 1
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
