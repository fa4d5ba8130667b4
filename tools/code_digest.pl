#!/usr/bin/perl
# Prints program_code, the digest of the sources of a program, as tools/common/key.c wants it.
# usage: code_digest.pl BUILD PROGRAM, with what the linker traces (-t -t) on stdin.
#
# These are the program's own file, what it takes of the library, and all that these include;
# tools/common, which writes no output, is left out. Of the files the tokens count: comments
# and spacing do not. So the digest does not depend on compiler, flags or directories.
use strict;
use warnings;
use Digest::SHA 'sha256_hex';

my ($build, $program) = @ARGV;
my %files;

# What an object was made of, from the rule that the compiler wrote for make.
sub add_sources {
	my ($rule) = @_;
	open my $f, '<', $rule or die "$rule: $!\n";
	my ($list) = join('', <$f>) =~ /^[^\n]*?:((?:\\\n|[^\n])*)/ or die "$rule: no rule\n";
	$files{$_} = 1 for grep { m{^(lib|formats|tools)/} && !m{^tools/common/} } split /[\s\\]+/, $list;
}

# The tokens of C, a line each; directives stay lines.
sub tokens {
	my ($text) = @_;
	my $literal = qr/"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'/;
	my $tokens = '';
	$text =~ s/\\\n/ /g;
	$text =~ s{($literal)|//[^\n]*|/\*.*?\*/}{$1 // ' '}gse;
	for my $line (split /\n/, $text) {
		if ($line =~ s/^\s*#\s*/#/) {
			$line =~ s{($literal)|\s+}{$1 // ' '}ge;
			$line =~ s/ $//;
			$tokens .= "$line\n";
			next;
		}
		$tokens .= "$_\n" for $line =~
			/$literal|[\w.]+|->|\+\+|--|<<=|>>=|<<|>>|&&|\|\||[-+*\/%&|^!=<>]=|\S/g;
	}
	return $tokens;
}

add_sources("$build/tools/$program.d");
my $members = 0;
while (<STDIN>) {
	next unless /libcommon\.a[()]+(\w+)\.o/;
	# A file that was moved leaves its old rule behind.
	my @sources = (glob("lib/*/$1.c"), glob("formats/*/$1.c"), glob("formats/*/$1.cc"));
	my @rules = map { "$build/" . s/\.cc?$/.d/r } @sources;
	die "$1.o: made of @{[scalar @rules]} files\n" if @rules != 1;
	add_sources($rules[0]);
	$members++;
}
die "$program: the linker does not tell what is in it\n" unless $members;

my $tokens = '';
for my $file (sort keys %files) {
	open my $f, '<', $file or die "$file: $!\n";
	$tokens .= tokens(join '', <$f>);
}
printf "const char program_code[33] = \"%.32s\";\n", sha256_hex($tokens);
