//! Takes out of a SPIR-V module what says only where it came from.
//!
//! A module is a header of five words (the magic number, the version, the generator, the bound of ids, zero)
//! and instructions. The first word of each has its length in words in the upper half, itself included, and its
//! opcode in the lower. `OpName %4 "a"` is four words long at most:
//!
//! ```text
//! 0x0003_0005   three words, opcode 5 (OpName)
//! 0x0000_0004   %4
//! 0x0000_0061   "a" and its zero, padded to a word
//! ```
//!
//! What is taken out changes nothing that is computed, and is in the way: Debian 12's validator does not know
//! the source language Slang, Mesa 22.3 fails where structs of different names are copied, and paths of a
//! temporary folder would make every output differ.

use std::collections::HashSet;

const MAGIC: u32 = 0x0723_0203;
const HEADER: usize = 5;

const OP_SOURCE_CONTINUED: u32 = 2;
const OP_SOURCE: u32 = 3;
const OP_SOURCE_EXTENSION: u32 = 4;
const OP_NAME: u32 = 5;
const OP_MEMBER_NAME: u32 = 6;
const OP_STRING: u32 = 7;
const OP_LINE: u32 = 8;
const OP_EXTENSION: u32 = 10;
const OP_EXT_INST_IMPORT: u32 = 11;
const OP_EXT_INST: u32 = 12;
const OP_DECORATE: u32 = 71;
const OP_NO_LINE: u32 = 317;
const OP_MODULE_PROCESSED: u32 = 330;
const OP_DECORATE_ID: u32 = 332;
const OP_EXT_INST_WITH_FORWARD_REFS: u32 = 4433;
const OP_DECORATE_STRING: u32 = 5632;

/// Why something is no SPIR-V module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Damaged {
    /// Its length.
    #[error("{0} bytes are no SPIR-V module: it ends within a word, or within the header of five words")]
    Cut(usize),
    /// Its first word.
    #[error("this is no SPIR-V module: its first word is {0:#010x}, not 0x07230203")]
    Magic(u32),
    /// Its first word has the bytes of the magic number backwards.
    #[error("this SPIR-V module was written for a machine of the other byte order")]
    Swapped,
    /// An instruction that is longer than what is left, or has no length at all.
    #[error("the SPIR-V module is damaged: the instruction at word {at} claims {claimed} of {left} words")]
    Instruction {
        /// Where it begins.
        at: usize,
        /// How long it says that it is.
        claimed: usize,
        /// How many words there are from there on.
        left: usize,
    },
}

/// The module without `OpSource…`, `OpString`, `OpLine`, `OpNoLine`, `OpModuleProcessed`, the instructions of
/// `NonSemantic.Shader.DebugInfo`, and, unless they are to stay, `OpName` and `OpMemberName`.
///
/// Strings stay where another non-semantic set, such as `DebugPrintf`, may need them.
///
/// # Errors
/// It is not a whole module of this machine's byte order.
pub fn clean(module: &[u8], keep_names: bool) -> Result<Vec<u8>, Damaged> {
    let words = words(module)?;
    let debug = Debug::find(&words)?;
    let mut kept = words[..HEADER].to_vec();
    for instruction in instructions(&words) {
        let instruction = instruction?;
        if !debug.contains(instruction) && !describes(instruction, keep_names, debug.keep_strings) {
            kept.extend(instruction);
        }
    }
    Ok(kept.iter().flat_map(|word| word.to_le_bytes()).collect())
}

/// Does it say only what something was called, or where it was written?
fn describes(instruction: &[u32], keep_names: bool, keep_strings: bool) -> bool {
    match opcode(instruction) {
        OP_SOURCE_CONTINUED | OP_SOURCE | OP_SOURCE_EXTENSION | OP_LINE | OP_NO_LINE
        | OP_MODULE_PROCESSED => true,
        OP_NAME | OP_MEMBER_NAME => !keep_names,
        OP_STRING => !keep_strings,
        _ => false,
    }
}

/// The ids that go with the debug information.
struct Debug {
    /// The instruction sets, and the results of their instructions.
    ids: HashSet<u32>,
    sets: HashSet<u32>,
    keep_strings: bool,
    keep_extension: bool,
}

impl Debug {
    fn find(words: &[u32]) -> Result<Self, Damaged> {
        let mut debug =
            Self { ids: HashSet::new(), sets: HashSet::new(), keep_strings: false, keep_extension: false };
        let mut strings = Vec::new();
        for instruction in instructions(words) {
            match (opcode(instruction?), &instruction?[1..]) {
                (OP_EXT_INST_IMPORT, [set, name @ ..]) => {
                    let name = string(name);
                    if name.starts_with(b"NonSemantic.Shader.DebugInfo.") {
                        debug.sets.insert(*set);
                        debug.ids.insert(*set);
                    } else if name.starts_with(b"NonSemantic.") {
                        debug.keep_strings = true;
                        debug.keep_extension = true;
                    }
                }
                (OP_EXT_INST | OP_EXT_INST_WITH_FORWARD_REFS, [_, result, set, ..])
                    if debug.sets.contains(set) =>
                {
                    debug.ids.insert(*result);
                }
                (OP_STRING, [result, ..]) => strings.push(*result),
                _ => {}
            }
        }
        if !debug.keep_strings {
            debug.ids.extend(strings);
        }
        // Where there was none, the extension is somebody else's business.
        debug.keep_extension |= debug.sets.is_empty();
        Ok(debug)
    }

    /// Is it debug information, or about some?
    fn contains(&self, instruction: &[u32]) -> bool {
        let id = |at: usize, ids: &HashSet<u32>| instruction.get(at).is_some_and(|id| ids.contains(id));
        match opcode(instruction) {
            OP_EXT_INST_IMPORT => id(1, &self.sets),
            OP_EXT_INST | OP_EXT_INST_WITH_FORWARD_REFS => id(3, &self.sets),
            OP_NAME | OP_MEMBER_NAME | OP_DECORATE | OP_DECORATE_ID | OP_DECORATE_STRING => id(1, &self.ids),
            OP_EXTENSION => !self.keep_extension && string(&instruction[1..]) == b"SPV_KHR_non_semantic_info",
            _ => false,
        }
    }
}

fn words(module: &[u8]) -> Result<Vec<u32>, Damaged> {
    let (words, rest) = module.as_chunks();
    let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
    match words.first() {
        Some(&MAGIC) => {}
        Some(&magic) if magic == MAGIC.swap_bytes() => return Err(Damaged::Swapped),
        Some(&magic) => return Err(Damaged::Magic(magic)),
        None => return Err(Damaged::Cut(module.len())),
    }
    if words.len() < HEADER || !rest.is_empty() { Err(Damaged::Cut(module.len())) } else { Ok(words) }
}

/// Each instruction with its first word; after an error comes nothing.
fn instructions(words: &[u32]) -> impl Iterator<Item = Result<&[u32], Damaged>> {
    let mut at = HEADER;
    std::iter::from_fn(move || {
        let (start, left) = (at, words.len() - at);
        let claimed = (*words.get(start)? >> 16) as usize;
        if claimed == 0 || claimed > left {
            at = words.len();
            return Some(Err(Damaged::Instruction { at: start, claimed, left }));
        }
        at += claimed;
        Some(Ok(&words[start..at]))
    })
}

fn opcode(instruction: &[u32]) -> u32 {
    instruction[0] & 0xffff
}

/// The bytes of a string up to its zero.
fn string(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const OP_CAPABILITY: u32 = 17;

    fn text(text: &str) -> Vec<u32> {
        let mut bytes = text.as_bytes().to_vec();
        bytes.push(0);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
    }

    fn op(opcode: u32, operands: &[u32]) -> Vec<u32> {
        let length = u32::try_from(operands.len() + 1).unwrap();
        [&[length << 16 | opcode], operands].concat()
    }

    fn module(instructions: &[Vec<u32>]) -> Vec<u8> {
        let header = vec![MAGIC, 0x0001_0500, 0, 100, 0];
        [header, instructions.concat()].concat().iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    fn with_text(ids: &[u32], name: &str) -> Vec<u32> {
        [ids, &text(name)].concat()
    }

    #[test]
    fn what_describes_goes_and_what_computes_stays() {
        let capability = op(OP_CAPABILITY, &[1]);
        let decorate = op(OP_DECORATE, &[4, 0]);
        let name = op(OP_NAME, &with_text(&[4], "a"));
        assert_eq!(name, [0x0003_0005, 4, 0x61]);
        let member = op(OP_MEMBER_NAME, &with_text(&[4, 0], "member"));
        let dirty = module(&[
            capability.clone(),
            op(OP_STRING, &with_text(&[9], "/tmp/a.slang")),
            op(OP_SOURCE, &[11, 1, 9]),
            op(OP_SOURCE_CONTINUED, &text("more")),
            op(OP_SOURCE_EXTENSION, &text("GL_x")),
            name.clone(),
            member.clone(),
            op(OP_MODULE_PROCESSED, &text("by us")),
            decorate.clone(),
            op(OP_LINE, &[9, 1, 1]),
            op(OP_NO_LINE, &[]),
        ]);
        assert_eq!(clean(&dirty, false).unwrap(), module(&[capability.clone(), decorate.clone()]));
        assert_eq!(clean(&dirty, true).unwrap(), module(&[capability, name, member, decorate]));
    }

    #[test]
    fn debug_information_goes_with_all_that_is_about_it() {
        let debug = "NonSemantic.Shader.DebugInfo.100";
        let dirty = module(&[
            op(OP_EXTENSION, &text("SPV_KHR_non_semantic_info")),
            op(OP_EXT_INST_IMPORT, &with_text(&[2], debug)),
            op(OP_EXT_INST_IMPORT, &with_text(&[3], "GLSL.std.450")),
            op(OP_NAME, &with_text(&[20], "of a debug instruction")),
            op(OP_NAME, &with_text(&[21], "x")),
            op(OP_EXT_INST, &[1, 20, 2, 35]),
            op(OP_EXT_INST, &[1, 21, 3, 4, 8]),
        ]);
        let cleaned = module(&[
            op(OP_EXT_INST_IMPORT, &with_text(&[3], "GLSL.std.450")),
            op(OP_NAME, &with_text(&[21], "x")),
            op(OP_EXT_INST, &[1, 21, 3, 4, 8]),
        ]);
        assert_eq!(clean(&dirty, true).unwrap(), cleaned);
    }

    #[test]
    fn what_a_kernel_prints_stays() {
        let prints = module(&[
            op(OP_EXTENSION, &text("SPV_KHR_non_semantic_info")),
            op(OP_EXT_INST_IMPORT, &with_text(&[2], "NonSemantic.DebugPrintf")),
            op(OP_STRING, &with_text(&[9], "%d")),
            op(OP_EXT_INST, &[1, 20, 2, 1, 9, 8]),
        ]);
        assert_eq!(clean(&prints, false).unwrap(), prints);
    }

    #[test]
    fn damage_is_named() {
        let whole = module(&[op(OP_CAPABILITY, &[1])]);
        assert_eq!(clean(&[], false), Err(Damaged::Cut(0)));
        assert_eq!(clean(&whole[..3], false), Err(Damaged::Cut(3)));
        assert_eq!(clean(&whole[..16], false), Err(Damaged::Cut(16)));
        assert_eq!(clean(&whole[..27], false), Err(Damaged::Cut(27)));
        assert_eq!(clean(&whole[..24], false), Err(Damaged::Instruction { at: 5, claimed: 2, left: 1 }));
        assert_eq!(clean(b"#version 460", false), Err(Damaged::Magic(0x7265_7623)));
        let swapped: Vec<u8> =
            whole.as_chunks::<4>().0.iter().flat_map(|w| [w[3], w[2], w[1], w[0]]).collect();
        assert_eq!(clean(&swapped, false), Err(Damaged::Swapped));
        let zero = module(&[vec![OP_CAPABILITY]]);
        let error = clean(&zero, false).unwrap_err();
        assert_eq!(error, Damaged::Instruction { at: 5, claimed: 0, left: 1 });
        assert_eq!(
            error.to_string(),
            "the SPIR-V module is damaged: the instruction at word 5 claims 0 of 1 words"
        );
    }

    proptest! {
        #[test]
        fn no_words_make_it_fail_otherwise(
            words in prop::collection::vec((0u32..5, prop_oneof![0u32..20, Just(71), Just(317), any::<u32>()]), 0..40),
            keep_names: bool,
        ) {
            let words: Vec<u32> = words.into_iter().map(|(length, op)| length << 16 | op).collect();
            let module = module(&[words]);
            if let Ok(cleaned) = clean(&module, keep_names) {
                prop_assert!(cleaned.len() <= module.len());
                prop_assert_eq!(clean(&cleaned, keep_names), Ok(cleaned));
            }
        }
    }
}
