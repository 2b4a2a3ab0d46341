#include "proto/config/config_text.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include "absl/strings/str_cat.h"
#include "proto/config/config_fields.h"

namespace dbr {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using google::protobuf::io::Tokenizer;

// Adds the tokenizer's own errors (an open string, an unexpected character) to the list.
class LexicalErrors : public google::protobuf::io::ErrorCollector {
 public:
  explicit LexicalErrors(std::vector<std::string>* errors) : errors_(errors) {}
  void AddError(int line, google::protobuf::io::ColumnNumber column, const std::string& message) override {
    errors_->push_back(absl::StrCat(line + 1, ":", column + 1, ": ", message));
  }

 private:
  std::vector<std::string>* errors_;
};

// Parses fields by recursive descent. Methods return false once the structure is broken. They record an error
// that leaves the structure clear and continue.
class TextReader {
 public:
  TextReader(absl::string_view text, std::vector<std::string>* errors)
      : errors_(errors),
        lexical_errors_(errors),
        input_(text.data(), static_cast<int>(text.size())),
        tokenizer_(&input_, &lexical_errors_) {
    tokenizer_.set_comment_style(Tokenizer::SH_COMMENT_STYLE);
    tokenizer_.Next();
  }

  // Reads fields until `closing`, and consumes it. "" means the end of the text.
  bool ReadFields(absl::string_view closing, const std::string& path, Message* message) {
    for (;;) {
      if (AtEnd()) return closing.empty() || Broken(absl::StrCat("'", closing, "'"));
      if (!closing.empty() && TryConsume(closing)) return true;
      if (!ReadField(path, message)) return false;
      TryConsume(",") || TryConsume(";");
    }
  }

 private:
  bool ReadField(const std::string& path, Message* message) {
    if (tokenizer_.current().type != Tokenizer::TYPE_IDENTIFIER) return Broken("the name of a field");
    const Tokenizer::Token token = tokenizer_.current();
    const std::string field_path = JoinPath(path, token.text);
    tokenizer_.Next();
    const bool colon = TryConsume(":");
    const FieldDescriptor* field = FindField(token.text, *message->GetDescriptor());
    if (field == nullptr) {
      NoteAt(token, field_path, UnknownField(token.text, *message->GetDescriptor()));
      return SkipValue();
    }
    NoteIfGivenBefore(token, field_path, *field, *message);
    const bool message_follows = LookingAt("{") || LookingAt("<");
    if (!colon && !message_follows) return Broken("':'");
    if (field->is_repeated() && LookingAt("[")) return ReadList(field_path, *field, message);
    return ReadValue(field_path, *field, message);
  }

  bool ReadList(const std::string& path, const FieldDescriptor& field, Message* message) {
    tokenizer_.Next();
    if (TryConsume("]")) return true;
    do {
      if (!ReadValue(path, field, message)) return false;
    } while (TryConsume(","));
    return TryConsume("]") || Broken("',' or ']'");
  }

  bool ReadValue(const std::string& path, const FieldDescriptor& field, Message* message) {
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      const bool angle = LookingAt("<");
      if (!TryConsume("{") && !TryConsume("<")) return Broken("'{'");
      const Reflection& reflection = *message->GetReflection();
      Message* child = field.is_repeated() ? reflection.AddMessage(message, &field)
                                           : reflection.MutableMessage(message, &field);
      return ReadFields(angle ? ">" : "}", path, child);
    }
    const Tokenizer::Token first = tokenizer_.current();
    const bool text_expected = field.cpp_type() == FieldDescriptor::CPPTYPE_STRING;
    const bool text_found = first.type == Tokenizer::TYPE_STRING;
    std::string value;
    if (!ReadScalar(&value)) return false;
    std::string error;
    if (text_expected && !text_found) {
      error = absl::StrCat("expected text in quotes, found ", value);
    } else {
      // Unexpected quotes stay in the text, which then is no value of the field's type.
      error =
          SetFromText(text_expected || !text_found ? value : absl::StrCat("\"", value, "\""), field, message);
    }
    if (!error.empty()) NoteAt(first, path, error);
    return true;
  }

  // Reads a scalar. Neighbouring strings are joined, without their quotes. Numbers and names keep their sign.
  bool ReadScalar(std::string* value) {
    if (tokenizer_.current().type == Tokenizer::TYPE_STRING) {
      while (tokenizer_.current().type == Tokenizer::TYPE_STRING) {
        Tokenizer::ParseStringAppend(tokenizer_.current().text, value);
        tokenizer_.Next();
      }
      return true;
    }
    if (TryConsume("-")) value->push_back('-');
    if (AtEnd() || tokenizer_.current().type == Tokenizer::TYPE_SYMBOL) return Broken("a value");
    *value += tokenizer_.current().text;
    tokenizer_.Next();
    return true;
  }

  // Skips a value of unknown type.
  bool SkipValue() {
    if (!LookingAt("{") && !LookingAt("<") && !LookingAt("[")) {
      std::string ignored;
      return ReadScalar(&ignored);
    }
    int depth = 0;
    do {
      if (AtEnd()) return Broken("a closing brace");
      if (LookingAt("{") || LookingAt("<") || LookingAt("[")) ++depth;
      if (LookingAt("}") || LookingAt(">") || LookingAt("]")) --depth;
      tokenizer_.Next();
    } while (depth > 0);
    return true;
  }

  void NoteIfGivenBefore(const Tokenizer::Token& token, const std::string& path, const FieldDescriptor& field,
                         const Message& message) {
    if (field.is_repeated()) return;
    const Reflection& reflection = *message.GetReflection();
    if (reflection.HasField(message, &field)) {
      NoteAt(token, path, "expected once, found again");
    } else if (field.containing_oneof() != nullptr &&
               reflection.HasOneof(message, field.containing_oneof())) {
      const FieldDescriptor* other = reflection.GetOneofFieldDescriptor(message, field.containing_oneof());
      NoteAt(token, path,
             absl::StrCat("expected one ", field.containing_oneof()->name(), ", found '", other->name(),
                          "' beside it"));
    }
  }

  void NoteAt(const Tokenizer::Token& token, const std::string& path, const std::string& what) {
    errors_->push_back(absl::StrCat(token.line + 1, ":", token.column + 1, ": ", path, ": ", what));
  }
  bool Broken(absl::string_view expected) {
    const Tokenizer::Token& token = tokenizer_.current();
    errors_->push_back(absl::StrCat(token.line + 1, ":", token.column + 1, ": expected ", expected,
                                    ", found ", AtEnd() ? "the end" : absl::StrCat("'", token.text, "'")));
    return false;
  }
  bool AtEnd() { return tokenizer_.current().type == Tokenizer::TYPE_END; }
  bool LookingAt(absl::string_view symbol) {
    return tokenizer_.current().type == Tokenizer::TYPE_SYMBOL && tokenizer_.current().text == symbol;
  }
  bool TryConsume(absl::string_view symbol) {
    if (!LookingAt(symbol)) return false;
    tokenizer_.Next();
    return true;
  }

  std::vector<std::string>* errors_;
  LexicalErrors lexical_errors_;
  google::protobuf::io::ArrayInputStream input_;
  Tokenizer tokenizer_;
};

}  // namespace

std::string JoinPath(const std::string& path, const std::string& name) {
  return path.empty() ? name : absl::StrCat(path, ".", name);
}

void ReadText(absl::string_view text, const std::string& path, Message* message,
              std::vector<std::string>* errors) {
  TextReader(text, errors).ReadFields("", path, message);
}

}  // namespace dbr
