//! Protocol Buffers (version 3), as far as messages are written: the wire format, and the descriptors by which a reader knows it.
//!
//! [`messages!`] makes a struct, its encoding and its descriptor of one list of fields.

/// What may stand once in a field.
pub trait Value: Default {
    /// The number of its type in descriptors.
    const TYPE: i32;
    /// The number of its type on the wire.
    const WIRE: u32;
    /// Whether several of it stand behind one tag.
    const PACKED: bool = false;

    /// Adds it without a tag.
    fn raw(&self, to: &mut Vec<u8>);

    /// Whether it is not written, since readers take it for granted.
    fn is_default(&self) -> bool;

    /// Full name of a message or an enumeration.
    fn type_name() -> String {
        String::new()
    }

    /// The enumeration that the message with this field declares.
    fn enumeration() -> Option<EnumDescriptorProto> {
        None
    }

    /// Adds the files that a message needs, its own last; returns the name of that.
    fn files(_: &mut Vec<FileDescriptorProto>) -> Option<String> {
        None
    }
}

/// What may stand in a field: a value, several, or one of which is said whether it is there.
pub trait Field {
    /// What it consists of.
    type Of: Value;
    /// 1: once, 3: several times.
    const LABEL: i32 = 1;
    /// Whether it is said if it is there.
    const OPTIONAL: bool = false;

    /// Adds it with its tag.
    fn put(&self, number: u32, to: &mut Vec<u8>);
}

/// A message.
pub trait Message: Value {
    /// Its full name.
    const NAME: &'static str;

    /// Its bytes.
    fn encode(&self) -> Vec<u8>;

    /// Its descriptor and those of all that it consists of, a FileDescriptorSet in bytes.
    fn descriptor() -> Vec<u8> {
        let mut file = Vec::new();
        Self::files(&mut file);
        FileDescriptorSet { file }.encode()
    }
}

/// Bytes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bytes(pub Vec<u8>);

pub fn varint(mut value: u64, to: &mut Vec<u8>) {
    while value >= 0x80 {
        to.push(value as u8 | 0x80);
        value >>= 7;
    }
    to.push(value as u8);
}

pub fn delimited(bytes: &[u8], to: &mut Vec<u8>) {
    varint(bytes.len() as u64, to);
    to.extend_from_slice(bytes);
}

fn tag(number: u32, wire: u32, to: &mut Vec<u8>) {
    varint(u64::from(number << 3 | wire), to);
}

const VARINT: u32 = 0;
const EIGHT_BYTES: u32 = 1;
pub const DELIMITED: u32 = 2;
const FOUR_BYTES: u32 = 5;

macro_rules! value {
    ($type:ty, $number:literal, $wire:ident, $packed:literal, |$value:ident, $to:ident| $raw:expr, $default:expr) => {
        impl Value for $type {
            const TYPE: i32 = $number;
            const WIRE: u32 = $wire;
            const PACKED: bool = $packed;

            fn raw(&self, $to: &mut Vec<u8>) {
                let $value = self;
                $raw
            }

            fn is_default(&self) -> bool {
                let $value = self;
                $default
            }
        }
    };
}

value!(f64, 1, EIGHT_BYTES, true, |v, to| to.extend_from_slice(&v.to_le_bytes()), v.to_bits() == 0);
value!(i64, 3, VARINT, true, |v, to| varint(*v as u64, to), *v == 0);
value!(i32, 5, VARINT, true, |v, to| varint(i64::from(*v) as u64, to), *v == 0);
// All of Foxglove's are of fixed length.
value!(u32, 7, FOUR_BYTES, true, |v, to| to.extend_from_slice(&v.to_le_bytes()), *v == 0);
value!(bool, 8, VARINT, true, |v, to| to.push(u8::from(*v)), !*v);
value!(String, 9, DELIMITED, false, |v, to| delimited(v.as_bytes(), to), v.is_empty());
value!(Bytes, 12, DELIMITED, false, |v, to| delimited(&v.0, to), v.0.is_empty());

impl<T: Value> Field for T {
    type Of = T;

    fn put(&self, number: u32, to: &mut Vec<u8>) {
        if !self.is_default() {
            tag(number, T::WIRE, to);
            self.raw(to);
        }
    }
}

impl<T: Value> Field for Vec<T> {
    type Of = T;
    const LABEL: i32 = 3;

    fn put(&self, number: u32, to: &mut Vec<u8>) {
        if T::PACKED && !self.is_empty() {
            let mut bytes = Vec::new();
            self.iter().for_each(|value| value.raw(&mut bytes));
            tag(number, DELIMITED, to);
            delimited(&bytes, to);
        } else {
            for value in self {
                tag(number, T::WIRE, to);
                value.raw(to);
            }
        }
    }
}

impl<T: Value> Field for Option<T> {
    type Of = T;
    const OPTIONAL: bool = true;

    fn put(&self, number: u32, to: &mut Vec<u8>) {
        if let Some(value) = self {
            tag(number, T::WIRE, to);
            value.raw(to);
        }
    }
}

/// Adds a message's file and, before it, those of its fields.
pub fn add_file(
    (path, name): (&str, &str),
    fields: Vec<Described>,
    files: &mut Vec<FileDescriptorProto>,
) -> Option<String> {
    if files.iter().all(|file| file.name != path) {
        let (package, message) = name.rsplit_once('.').unwrap_or(("", name));
        let mut descriptor = DescriptorProto { name: message.to_owned(), ..Default::default() };
        let mut dependency: Vec<String> = Vec::new();
        for Described { mut field, files: needed, enumeration } in fields {
            let needed = needed(files).filter(|needed| needed != path && !dependency.contains(needed));
            dependency.extend(needed);
            descriptor.enum_type.extend(enumeration);
            if field.proto3_optional {
                field.oneof_index = Some(descriptor.oneof_decl.len() as i32);
                descriptor.oneof_decl.push(OneofDescriptorProto { name: format!("_{}", field.name) });
            }
            descriptor.field.push(field);
        }
        files.push(FileDescriptorProto {
            name: path.to_owned(),
            package: package.to_owned(),
            dependency,
            message_type: vec![descriptor],
            syntax: "proto3".to_owned(),
        });
    }
    Some(path.to_owned())
}

/// A field, and what it needs.
pub struct Described {
    field: FieldDescriptorProto,
    files: fn(&mut Vec<FileDescriptorProto>) -> Option<String>,
    enumeration: Option<EnumDescriptorProto>,
}

impl Described {
    /// A field of this type.
    pub fn new<F: Field>(name: &str, number: u32) -> Self {
        let field = FieldDescriptorProto {
            name: name.trim_start_matches("r#").to_owned(),
            number: number as i32,
            label: F::LABEL,
            r#type: F::Of::TYPE,
            type_name: F::Of::type_name(),
            oneof_index: None,
            proto3_optional: F::OPTIONAL,
        };
        Self { field, files: F::Of::files, enumeration: F::Of::enumeration() }
    }
}

/// Messages: name, file and full name, and the fields with their numbers.
macro_rules! messages {
    ($($(#[$about:meta])* $name:ident in $file:literal as $full:literal { $($number:literal $field:ident: $type:ty,)* })+) => {$(
        $(#[$about])*
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct $name {
            $(pub $field: $type,)*
        }

        impl $crate::record::mcap::proto::Value for $name {
            const TYPE: i32 = 11;
            const WIRE: u32 = $crate::record::mcap::proto::DELIMITED;

            fn raw(&self, to: &mut Vec<u8>) {
                $crate::record::mcap::proto::delimited(&$crate::record::mcap::proto::Message::encode(self), to);
            }

            fn is_default(&self) -> bool {
                // What a message has readers look for without asking whether it is there.
                false
            }

            fn type_name() -> String {
                concat!(".", $full).to_owned()
            }

            fn files(files: &mut Vec<$crate::record::mcap::proto::FileDescriptorProto>) -> Option<String> {
                let fields = vec![$($crate::record::mcap::proto::Described::new::<$type>(stringify!($field), $number)),*];
                $crate::record::mcap::proto::add_file(($file, $full), fields, files)
            }
        }

        impl $crate::record::mcap::proto::Message for $name {
            const NAME: &'static str = $full;

            fn encode(&self) -> Vec<u8> {
                let mut bytes = Vec::new();
                $($crate::record::mcap::proto::Field::put(&self.$field, $number, &mut bytes);)*
                bytes
            }
        }
    )+};
}

/// Enumerations of messages: name, full name, and the values with their numbers, 0 first.
macro_rules! enumerations {
    ($($name:ident as $full:literal { $first:ident = $zero:literal, $($value:ident = $word:literal,)* })+) => {$(
        #[derive(Debug, Clone, Copy, Default, PartialEq)]
        #[allow(dead_code, reason = "readers are told of all")]
        pub enum $name {
            #[default]
            $first,
            $($value,)*
        }

        impl $crate::record::mcap::proto::Value for $name {
            const TYPE: i32 = 14;
            const WIRE: u32 = 0;

            fn raw(&self, to: &mut Vec<u8>) {
                to.push(*self as u8);
            }

            fn is_default(&self) -> bool {
                *self as u8 == 0
            }

            fn type_name() -> String {
                concat!(".", $full).to_owned()
            }

            fn enumeration() -> Option<$crate::record::mcap::proto::EnumDescriptorProto> {
                Some($crate::record::mcap::proto::EnumDescriptorProto::of($full, &[$zero, $($word),*]))
            }
        }
    )+};
}

pub(super) use {enumerations, messages};

impl EnumDescriptorProto {
    /// With these values, from 0 on.
    pub fn of(full: &str, words: &[&str]) -> Self {
        let value = |(number, word): (i32, &&str)| EnumValueDescriptorProto {
            name: (*word).to_owned(),
            number: Some(number),
        };
        let name = full.rsplit('.').next().unwrap_or(full).to_owned();
        Self { name, value: (0..).zip(words).map(value).collect() }
    }
}

messages! {
    /// Files, each after those that it needs.
    FileDescriptorSet in "google/protobuf/descriptor.proto" as "google.protobuf.FileDescriptorSet" {
        1 file: Vec<FileDescriptorProto>,
    }
    FileDescriptorProto in "google/protobuf/descriptor.proto" as "google.protobuf.FileDescriptorProto" {
        1 name: String,
        2 package: String,
        3 dependency: Vec<String>,
        4 message_type: Vec<DescriptorProto>,
        12 syntax: String,
    }
    DescriptorProto in "google/protobuf/descriptor.proto" as "google.protobuf.DescriptorProto" {
        1 name: String,
        2 field: Vec<FieldDescriptorProto>,
        4 enum_type: Vec<EnumDescriptorProto>,
        8 oneof_decl: Vec<OneofDescriptorProto>,
    }
    FieldDescriptorProto in "google/protobuf/descriptor.proto" as "google.protobuf.FieldDescriptorProto" {
        1 name: String,
        3 number: i32,
        4 label: i32,
        5 r#type: i32,
        6 type_name: String,
        9 oneof_index: Option<i32>,
        17 proto3_optional: bool,
    }
    OneofDescriptorProto in "google/protobuf/descriptor.proto" as "google.protobuf.OneofDescriptorProto" {
        1 name: String,
    }
    EnumDescriptorProto in "google/protobuf/descriptor.proto" as "google.protobuf.EnumDescriptorProto" {
        1 name: String,
        2 value: Vec<EnumValueDescriptorProto>,
    }
    EnumValueDescriptorProto in "google/protobuf/descriptor.proto" as "google.protobuf.EnumValueDescriptorProto" {
        1 name: String,
        2 number: Option<i32>,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    messages! {
        Inner in "t/Inner.proto" as "t.Inner" {
            1 a: i32,
        }
        Outer in "t/Outer.proto" as "t.Outer" {
            1 a: i32,
            2 b: String,
            3 inner: Inner,
            4 numbers: Vec<i32>,
            5 zero: Option<f64>,
        }
    }

    /// The first three are the examples of the public description of the encoding.
    #[test]
    fn messages_are_encoded_as_the_format_is_described() {
        assert_eq!(Outer { a: 150, ..Default::default() }.encode(), [0x08, 0x96, 0x01, 0x1a, 0x00]);
        let text = Outer { b: "testing".into(), inner: Inner { a: 150 }, ..Default::default() }.encode();
        assert_eq!(text, *b"\x12\x07testing\x1a\x03\x08\x96\x01");
        let packed = Outer { numbers: vec![3, 270, 86_942], ..Default::default() }.encode();
        assert_eq!(packed, [0x1a, 0x00, 0x22, 0x06, 0x03, 0x8e, 0x02, 0x9e, 0xa7, 0x05]);
        // A zero of which is said that it is there; a negative number has ten bytes.
        assert_eq!(
            Outer { zero: Some(0.0), ..Default::default() }.encode()[2..],
            [0x29, 0, 0, 0, 0, 0, 0, 0, 0]
        );
        assert_eq!(Inner { a: -1 }.encode().len(), 11);
    }

    #[test]
    fn what_a_message_needs_is_described_before_it() {
        let mut files = Vec::new();
        Outer::files(&mut files);
        let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
        assert_eq!(names, ["t/Inner.proto", "t/Outer.proto"]);
        assert_eq!(files[1].dependency, ["t/Inner.proto"]);
        let optional = &files[1].message_type[0].field[4];
        assert_eq!((optional.oneof_index, optional.proto3_optional), (Some(0), true));
    }
}
