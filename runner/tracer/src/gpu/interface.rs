//! Reads from compiled SPIR-V what a shader believes about memory, for tests that hold it against the
//! host's structs. Only in test builds.

use super::{Shader, device::PUSH_BYTES, shaders};
use crate::permutations::{ARITIES, IN_SLANG, KINDS, Layout, PER_ARITY, PER_LAYOUT};
use std::collections::{BTreeSet, HashMap};

/// A field as the host lays it out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Field {
    pub name: &'static str,
    pub offset: usize,
    pub size: usize,
}

/// The fields of a struct, those that only pad it left out: `fields!(Ray: origin, t_min)`.
macro_rules! fields {
    ($type:ty: $($field:ident),+ $(,)?) => {{
        fn size<S, F>(_: fn(&S) -> &F) -> usize {
            size_of::<F>()
        }
        vec![$($crate::gpu::interface::Field {
            name: stringify!($field),
            offset: std::mem::offset_of!($type, $field),
            size: size::<$type, _>(|s| &s.$field),
        }),+]
    }};
}
pub(crate) use fields;

#[derive(Clone, Debug)]
enum Type {
    /// A scalar or a pointer.
    Bytes(u32),
    Vector(u32, u32),
    Array(u32, u32),
    RuntimeArray(u32),
    Struct(Vec<u32>),
}

/// What matters here of one SPIR-V module.
pub(crate) struct Module {
    shader: &'static str,
    types: HashMap<u32, Type>,
    pointees: HashMap<u32, u32>,
    constants: HashMap<u32, u32>,
    names: HashMap<u32, String>,
    member_names: HashMap<(u32, u32), String>,
    offsets: HashMap<(u32, u32), u32>,
    strides: HashMap<u32, u32>,
    spec_ids: HashMap<u32, u32>,
    /// The constant that is the workgroup's size, and what it is made of.
    workgroup: Vec<u32>,
    push_constants: Option<u32>,
}

fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|b| *b != 0).collect();
    String::from_utf8(bytes).unwrap()
}

impl Module {
    pub fn read(shader: &Shader) -> Self {
        let words: Vec<u32> =
            shader.spirv.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(words[0], 0x0723_0203, "{} is SPIR-V", shader.name);
        let mut m = Self {
            shader: shader.name,
            types: HashMap::new(),
            pointees: HashMap::new(),
            constants: HashMap::new(),
            names: HashMap::new(),
            member_names: HashMap::new(),
            offsets: HashMap::new(),
            strides: HashMap::new(),
            spec_ids: HashMap::new(),
            workgroup: Vec::new(),
            push_constants: None,
        };
        let mut composites: HashMap<u32, Vec<u32>> = HashMap::new();
        let mut built_in_size = None;
        let mut at = 5;
        while at < words.len() {
            let (length, code) = ((words[at] >> 16) as usize, words[at] & 0xFFFF);
            let o = &words[at + 1..at + length];
            match code {
                5 => _ = m.names.insert(o[0], text(&o[1..])),
                6 => _ = m.member_names.insert((o[0], o[1]), text(&o[2..])),
                // Execution modes LocalSize, which the decorated constant overrides, and LocalSizeId.
                331 if o[1] == 38 => m.workgroup = o[2..].to_vec(),
                20 => _ = m.types.insert(o[0], Type::Bytes(4)),
                21 | 22 => _ = m.types.insert(o[0], Type::Bytes(o[1] / 8)),
                23 => _ = m.types.insert(o[0], Type::Vector(o[1], o[2])),
                28 => _ = m.types.insert(o[0], Type::Array(o[1], o[2])),
                29 => _ = m.types.insert(o[0], Type::RuntimeArray(o[1])),
                30 => _ = m.types.insert(o[0], Type::Struct(o[1..].to_vec())),
                32 => {
                    m.types.insert(o[0], Type::Bytes(8));
                    m.pointees.insert(o[0], o[2]);
                }
                43 => _ = m.constants.insert(o[1], o[2]),
                51 => _ = composites.insert(o[1], o[2..].to_vec()),
                // A variable in storage class PushConstant.
                59 if o[2] == 9 => m.push_constants = Some(m.pointees[&o[0]]),
                71 => match o[1] {
                    1 => _ = m.spec_ids.insert(o[0], o[2]),
                    6 => _ = m.strides.insert(o[0], o[2]),
                    11 if o[2] == 25 => built_in_size = Some(o[0]),
                    _ => {}
                },
                72 if o[2] == 35 => _ = m.offsets.insert((o[0], o[1]), o[3]),
                _ => {}
            }
            at += length;
        }
        if let Some(parts) = built_in_size.and_then(|id| composites.get(&id)) {
            m.workgroup.clone_from(parts);
        }
        m
    }

    fn size(&self, id: u32) -> usize {
        match &self.types[&id] {
            Type::Bytes(n) => *n as usize,
            Type::Vector(of, n) => self.size(*of) * *n as usize,
            Type::Array(of, n) => {
                self.strides[&id] as usize * (self.constants[n] as usize - 1) + self.size(*of)
            }
            Type::RuntimeArray(_) => 0,
            Type::Struct(members) => {
                let end = |(i, of): (usize, &u32)| self.offsets[&(id, i as u32)] as usize + self.size(*of);
                members.iter().enumerate().map(end).max().unwrap_or(0)
            }
        }
    }

    fn compare(&self, id: u32, what: &str, host: &[Field]) {
        let Type::Struct(members) = &self.types[&id] else { panic!("{what} is no struct") };
        let shader: Vec<_> = members
            .iter()
            .enumerate()
            .map(|(i, of)| {
                let key = (id, i as u32);
                // `sample` is a word of GLSL.
                let name = self.member_names[&key].trim_end_matches('_').to_owned();
                (name, self.offsets[&key] as usize, self.size(*of))
            })
            .collect();
        let host: Vec<_> = host.iter().map(|f| (f.name.to_owned(), f.offset, f.size)).collect();
        assert_eq!(shader, host, "{}: {what}, shader left, host right: (name, offset, size)", self.shader);
    }

    /// The push constants are laid out as the host's struct of `size` bytes.
    pub fn assert_push_constants(&self, size: usize, host: &[Field]) -> &Self {
        let id = self.push_constants.expect("every kernel has arguments");
        self.compare(id, "push constants", host);
        assert!(size >= self.size(id) && size <= PUSH_BYTES as usize, "{}: {size} bytes", self.shader);
        self
    }

    /// The buffer block of this name; function-local copies of a struct carry no offsets.
    fn block(&self, name: &str) -> u32 {
        let found: Vec<_> = self
            .names
            .iter()
            .filter(|(id, n)| *n == name && self.offsets.contains_key(&(**id, 0)))
            .map(|(id, _)| *id)
            .collect();
        assert_eq!(found.len(), 1, "{}: blocks called {name}", self.shader);
        found[0]
    }

    /// Items of the unbounded array that ends a block lie `stride` bytes apart; and where `host` is given,
    /// they are laid out so.
    pub fn assert_items(&self, block: &str, stride: usize, host: Option<&[Field]>) -> &Self {
        let id = self.block(block);
        let Type::Struct(members) = &self.types[&id] else { panic!("{block} is no struct") };
        let array = *members.last().unwrap();
        let Type::RuntimeArray(item) = self.types[&array] else { panic!("{block} ends in no array") };
        assert_eq!(self.strides[&array] as usize, stride, "{}: stride of {block}", self.shader);
        assert!(self.size(item) <= stride, "{}: size of an item of {block}", self.shader);
        if let Some(host) = host {
            self.compare(item, block, host);
        }
        self
    }

    /// Specialization constant `id` is the one of this name.
    pub fn assert_specialization(&self, id: u32, name: &str) -> &Self {
        let found: Vec<_> =
            self.spec_ids.iter().filter(|(_, i)| **i == id).map(|(of, _)| self.names.get(of)).collect();
        assert_eq!(found, [Some(&name.to_owned())], "{}: constant {id}", self.shader);
        self
    }

    /// A block is laid out as a struct of the host.
    pub fn assert_block(&self, block: &str, host: &[Field]) -> &Self {
        self.compare(self.block(block), block, host);
        self
    }
}

/// Shaders by name whose sources are to be found among those compiled.
fn all() -> impl Iterator<Item = Module> {
    shaders::ALL.iter().map(|s| Module::read(s))
}

/// Whether a shader's source is of a kind.
fn is(shader: &str, kind: &str) -> bool {
    let source = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(shader);
    source.with_extension(kind).exists()
}

#[test]
fn arguments_fit_the_push_constants_of_every_device() {
    for m in all() {
        // These are called by a shader that has.
        if ["rmiss", "rchit"].iter().any(|kind| is(m.shader, kind)) {
            assert!(m.push_constants.is_none(), "{}", m.shader);
            continue;
        }
        let id = m.push_constants.unwrap_or_else(|| panic!("{} has no arguments", m.shader));
        assert!(m.size(id) <= PUSH_BYTES as usize, "{}: {} bytes", m.shader, m.size(id));
    }
}

#[test]
fn constant_0_is_the_workgroup_size_in_every_shader_and_constants_are_numbered_without_gaps() {
    // The driver chooses the workgroups of its own ray tracing.
    let own = |m: &Module| KINDS[1..].iter().any(|kind| is(m.shader, kind));
    assert_eq!(all().filter(own).count(), 3);
    for m in all().filter(|m| !own(m)) {
        assert_eq!(m.workgroup.len(), 3, "{}: the workgroup size is a specialization constant", m.shader);
        assert_eq!(m.spec_ids.get(&m.workgroup[0]), Some(&0), "{}", m.shader);
        for axis in &m.workgroup[1..] {
            assert_eq!(m.constants.get(axis), Some(&1), "{}: workgroups are rows", m.shader);
        }
        let ids: BTreeSet<u32> = m.spec_ids.values().copied().collect();
        assert_eq!(ids.len(), m.spec_ids.len(), "{}: an id is used twice", m.shader);
    }
}

#[test]
fn every_shader_is_in_the_list_once() {
    let names: BTreeSet<_> = shaders::ALL.iter().map(|s| s.name).collect();
    assert_eq!(names.len(), shaders::ALL.len());
    assert!(shaders::ALL.iter().all(|s| s.sha256().len() == 64));
    let mut sources = Vec::new();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    find(&root, &mut sources);
    let expected: BTreeSet<String> = sources
        .iter()
        .flat_map(|source| {
            let stem = source.strip_prefix(&root).unwrap().with_extension("");
            let stem = stem.to_str().unwrap().to_owned();
            if PER_LAYOUT.contains(&&*stem) {
                let glsl = Layout::ALL.iter().map(|l| format!("{stem}/{}", l.symbol()));
                let in_slang = IN_SLANG.contains(&&*stem) && shaders::SLANG_MISSING.is_none();
                let slang = Layout::ALL.iter().filter(|l| in_slang && l.slang().is_some());
                glsl.chain(slang.map(|l| format!("{stem}/{}/slang", l.symbol()))).collect()
            } else if PER_ARITY.contains(&&*stem) {
                ARITIES.iter().map(|arity| format!("{stem}/{arity}")).collect()
            } else {
                vec![stem]
            }
        })
        .collect();
    assert_eq!(names, expected.iter().map(|s| &**s).collect());
}

fn find(folder: &std::path::Path, sources: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            find(&path, sources);
        } else if path.extension().is_some_and(|e| KINDS.iter().any(|kind| e == *kind)) {
            sources.push(path);
        }
    }
}
