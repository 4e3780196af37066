# SPDX-License-Identifier: GPL-3.0-or-later
"""Renames dynamic symbols and needed libraries of an x86-64 ELF shared library.

The symbol table keeps its order, so relocations and versions stay as they are. Names and the hash
table that finds them are written anew into a segment at the end of the file, whose program header
is taken from the build id's note; the old names are zeroed. System V ABI, chapter 5.
"""

import struct

PT_LOAD, PT_DYNAMIC, PT_NOTE = 1, 2, 4
SHT_STRTAB, SHT_HASH, SHT_DYNSYM, SHT_GNU_HASH = 3, 5, 11, 0x6FFFFFF6
DT_NULL, DT_NEEDED, DT_HASH, DT_STRTAB, DT_SYMTAB, DT_STRSZ = 0, 1, 4, 5, 6, 10
DT_SONAME, DT_RPATH, DT_RUNPATH, DT_GNU_HASH = 14, 15, 29, 0x6FFFFEF5
DT_VERDEF, DT_VERDEFNUM, DT_VERNEED, DT_VERNEEDNUM = 0x6FFFFFFC, 0x6FFFFFFD, 0x6FFFFFFE, 0x6FFFFFFF
STB_LOCAL, SHN_UNDEF = 0, 0
PAGE = 4096


class ElfError(Exception):
    """The file is not what this module can rewrite; the message says which and why."""


def _aligned(value, to=PAGE):
    return (value + to - 1) // to * to


def _hash(name):
    h = 0
    for byte in name:
        h = (h << 4) + byte
        g = h & 0xF0000000
        h = (h ^ (g >> 24)) & ~g & 0xFFFFFFFF
    return h


class _Strings:
    """A string table under construction."""

    def __init__(self):
        self.data = bytearray(b"\0")
        self._at = {b"": 0}

    def put(self, text):
        if text not in self._at:
            self._at[text] = len(self.data)
            self.data += text + b"\0"
        return self._at[text]


class SharedLibrary:
    """The dynamic part of one file, read and rewritten in memory."""

    def __init__(self, path):
        self.path = path
        with open(path, "rb") as file:
            self.data = bytearray(file.read())
        if self.data[:6] != b"\x7fELF\x02\x01" or self._get("<H", 18)[0] != 62:
            raise ElfError(f"{path}: not an x86-64 ELF file")
        (self._phoff, self._shoff) = self._get("<QQ", 32)
        (self._phnum,) = self._get("<H", 56)
        (self._shnum,) = self._get("<H", 60)
        self._segments = [list(self._get("<IIQQQQQQ", self._phoff + 56 * i)) for i in range(self._phnum)]
        self._sections = [list(self._get("<IIQQQQIIQQ", self._shoff + 64 * i)) for i in range(self._shnum)]
        self._read_dynamic()

    def _get(self, form, offset):
        return struct.unpack_from(form, self.data, offset)

    def _put(self, form, offset, *values):
        struct.pack_into(form, self.data, offset, *values)

    def _offset(self, address):
        for kind, _, offset, start, _, size, *_ in self._segments:
            if kind == PT_LOAD and start <= address < start + size:
                return offset + address - start
        raise ElfError(f"{self.path}: address {address:#x} is in no segment")

    def _read_dynamic(self):
        (dynamic,) = (s for s in self._segments if s[0] == PT_DYNAMIC)
        self._entries = []  # [offset of the entry, tag, value], DT_NULL ones at the end too
        for offset in range(dynamic[2], dynamic[2] + dynamic[5], 16):
            tag, value = self._get("<qQ", offset)
            self._entries.append([offset, tag, value])
        self._tags = {tag: value for _, tag, value in self._entries if tag != DT_NULL}
        self._strings_at = self._offset(self._tags[DT_STRTAB])
        self._symbols_at = self._offset(self._tags[DT_SYMTAB])
        (table,) = (s for s in self._sections if s[1] == SHT_DYNSYM)
        self._symbol_count = table[5] // 24

    def _string(self, index):
        start = self._strings_at + index
        return bytes(self.data[start : self.data.index(0, start)])

    def _symbols(self):
        for i in range(1, self._symbol_count):
            at = self._symbols_at + 24 * i
            name, info, _other, section = self._get("<IBBH", at)
            yield i, at, self._string(name), info >> 4, section

    def defined(self):
        """Names of the symbols that this file gives to others."""
        return {n.decode() for _, _, n, bind, section in self._symbols() if bind and section != SHN_UNDEF}

    def needed(self):
        return [self._string(value).decode() for _, tag, value in self._entries if tag == DT_NEEDED]

    def rewrite(self, *, symbols, libraries, soname, run_path):
        """`symbols` and `libraries` map old names to new ones; others stay."""
        symbols = {k.encode(): v.encode() for k, v in symbols.items()}
        libraries = {k.encode(): v.encode() for k, v in libraries.items()}
        strings = _Strings()
        defined = []
        for index, at, name, bind, section in list(self._symbols()):
            new = symbols.get(name, name) if bind != STB_LOCAL else name
            self._put("<I", at, strings.put(new))
            if bind != STB_LOCAL and section != SHN_UNDEF:
                defined.append((index, new))
        self._rewrite_versions(strings, libraries, soname)
        self._rewrite_names(strings, libraries, soname, run_path)
        self._append(strings, self._hash_table(defined))

    def _rewrite_versions(self, strings, libraries, soname):
        at = self._tags.get(DT_VERNEED)
        at = at and self._offset(at)
        for _ in range(self._tags.get(DT_VERNEEDNUM, 0)):
            _, count, file, aux, after = self._get("<HHIII", at)
            file = self._string(file)
            self._put("<I", at + 4, strings.put(libraries.get(file, file)))
            aux += at
            for _ in range(count):
                name, following = self._get("<II", aux + 8)
                self._put("<I", aux + 8, strings.put(self._string(name)))
                aux += following
            at += after
        at = self._tags.get(DT_VERDEF)
        at = at and self._offset(at)
        for number in range(self._tags.get(DT_VERDEFNUM, 0)):
            _, _, _, count, _, aux, after = self._get("<HHHHIII", at)
            aux += at
            for _ in range(count):
                name, following = self._get("<II", aux)
                # The first definition is the library itself, under its soname.
                new = soname.encode() if number == 0 and soname else self._string(name)
                self._put("<I", aux, strings.put(new))
                aux += following
            at += after

    def _rewrite_names(self, strings, libraries, soname, run_path):
        spare = [entry for entry in self._entries if entry[1] == DT_NULL]
        for entry in self._entries:
            offset, tag, value = entry
            if tag == DT_NEEDED:
                old = self._string(value)
                self._put("<Q", offset + 8, strings.put(libraries.get(old, old)))
            elif tag == DT_SONAME:
                self._put("<Q", offset + 8, strings.put(soname.encode() if soname else self._string(value)))
            elif tag in (DT_RPATH, DT_RUNPATH):
                self._put("<qQ", offset, DT_RUNPATH, strings.put(run_path.encode()))
        if DT_RPATH not in self._tags and DT_RUNPATH not in self._tags:
            if len(spare) < 2:
                raise ElfError(f"{self.path}: no spare dynamic entry for a run path")
            self._put("<qQ", spare[0][0], DT_RUNPATH, strings.put(run_path.encode()))

    def _hash_table(self, defined):
        buckets = max(1, len(defined))
        heads = [0] * buckets
        chains = [0] * self._symbol_count
        for index, name in reversed(defined):
            bucket = _hash(name) % buckets
            chains[index] = heads[bucket]
            heads[bucket] = index
        return struct.pack(f"<{2 + buckets + len(chains)}I", buckets, len(chains), *heads, *chains)

    def _append(self, strings, table):
        loads = [s for s in self._segments if s[0] == PT_LOAD]
        last_load = max(i for i, s in enumerate(self._segments) if s[0] == PT_LOAD)
        notes = [i for i, s in enumerate(self._segments) if s[0] == PT_NOTE and i > last_load]
        if not notes:
            raise ElfError(f"{self.path}: no note whose program header could be taken")
        address = _aligned(max(s[3] + s[6] for s in loads))
        offset = _aligned(len(self.data))
        strings_size = _aligned(len(strings.data), 8)
        size = strings_size + len(table)

        for old in (s for s in self._sections if s[1] in (SHT_GNU_HASH, SHT_HASH)):
            self.data[old[4] : old[4] + old[5]] = bytes(old[5])
        end = self._strings_at + self._tags[DT_STRSZ]
        self.data[self._strings_at : end] = bytes(end - self._strings_at)

        self.data += bytes(offset - len(self.data))
        self.data += strings.data + bytes(strings_size - len(strings.data)) + table
        self._put(
            "<IIQQQQQQ", self._phoff + 56 * notes[-1], PT_LOAD, 4, offset, address, address, size, size, PAGE
        )
        table_address = address + strings_size
        hash_is_set = False
        for at, tag, _ in self._entries:
            if tag == DT_STRTAB:
                self._put("<Q", at + 8, address)
            elif tag == DT_STRSZ:
                self._put("<Q", at + 8, len(strings.data))
            elif tag in (DT_GNU_HASH, DT_HASH):
                # A second table, where there are both kinds, becomes a harmless repetition.
                self._put("<qQ", at, DT_HASH, table_address)
                hash_is_set = True
        if not hash_is_set:
            raise ElfError(f"{self.path}: has no symbol hash table")
        self._describe(strings, address, offset, strings_size, len(table))

    def _describe(self, strings, address, offset, strings_size, table_size):
        """Section headers: the loader ignores them, readelf and debuggers do not."""
        for i, section in enumerate(self._sections):
            at = self._shoff + 64 * i
            if section[1] == SHT_STRTAB and section[4] == self._strings_at:
                self._put("<QQQ", at + 16, address, offset, len(strings.data))
            elif section[1] in (SHT_GNU_HASH, SHT_HASH):
                self._put("<I", at + 4, SHT_HASH)
                self._put("<QQQ", at + 16, address + strings_size, offset + strings_size, table_size)
                self._put("<Q", at + 56, 4)

    def save(self, path):
        with open(path, "wb") as file:
            file.write(self.data)
